"""The actions that the engine executes, and their registry."""
