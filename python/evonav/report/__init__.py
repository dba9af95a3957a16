"""Tables, maps and pages made from the records of a run, and from nothing else."""
