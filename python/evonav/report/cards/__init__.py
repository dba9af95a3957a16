"""Write what dataset hubs read: a dataset card, Croissant metadata, and a benchmark's description and results."""
