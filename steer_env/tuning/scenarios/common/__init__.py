"""What tuning scenarios share: their declaration and the on-centre test."""
