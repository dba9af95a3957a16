"""Memories of other libraries, to compare ours with (extra `bench`)."""
