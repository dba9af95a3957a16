"""A stand-in for a VLM: rules that weigh colours, sizes, forms and surroundings, and need no network."""
