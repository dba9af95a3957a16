"""`evonav bench`."""
