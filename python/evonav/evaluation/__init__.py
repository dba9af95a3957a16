"""The multi-stage protocol, metrics, records."""
