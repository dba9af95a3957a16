"""Run jobs on local processes or Ray actors, and write folders that survive a crash."""
