"""UniGoal: the agent, its memory, its questions and its rules."""
