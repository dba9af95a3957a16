"""What an agent senses."""
