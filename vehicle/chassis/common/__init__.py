"""What chassis models have in common: their interface to the plant, and their registry."""
