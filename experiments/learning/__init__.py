"""Training of policies, and their evaluation on held-out episodes."""
