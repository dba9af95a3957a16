"""What an agent remembers: occupancy, frontiers, object entries."""
