"""Write the instructions of tasks: by rule (`describe`, `appearance`) or with a model (`writer`, `prompts`)."""
