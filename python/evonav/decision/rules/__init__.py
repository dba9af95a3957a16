"""The text matcher's answers, a file an agent family."""
