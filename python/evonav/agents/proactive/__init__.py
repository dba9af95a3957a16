"""Belief-Weighted Search: keeps a posterior over the target's place, and goes where most of it is found a metre."""
