"""Decision models: what agents ask, and a model that answers without a network."""
