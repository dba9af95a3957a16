"""Pack a run into one file and verify such a file by scoring it again."""
