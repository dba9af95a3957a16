"""Models behind predicted perception, one library a file; each is loaded once a process and shared."""
