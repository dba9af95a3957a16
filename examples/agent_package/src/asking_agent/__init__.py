"""An agent for EvoNav-Bench with a question of its own."""
