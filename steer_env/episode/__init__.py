"""What an episode is given: its clock, and the conditions that a reset draws."""
