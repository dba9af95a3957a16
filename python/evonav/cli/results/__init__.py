"""Commands that show, compare and export the results of runs."""
