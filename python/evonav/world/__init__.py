"""The world behind one simulator protocol."""
