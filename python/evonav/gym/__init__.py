"""Gymnasium environments over the embedded simulator."""
