"""Write the instructions of tasks: by rule (`describe`) or with a model (`writer`)."""
