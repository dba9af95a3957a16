"""Frontier-Update, Stage-Reset and Fail-then-Update: the agent, its memory, its questions and its rules."""
