"""Transports of AI2-THOR's client: named pipes (FIFO) and HTTP (WSGI)."""
