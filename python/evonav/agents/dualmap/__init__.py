"""DualMap: furniture is remembered with what lies on it, everything else only as long as it is near."""
