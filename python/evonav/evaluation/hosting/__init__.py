"""Run agents in processes of their own."""
