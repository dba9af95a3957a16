"""Memories of other libraries, run beside ours (extra `bench`)."""
