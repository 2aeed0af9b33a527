"""Tuning of a car's assist against target bands, for the worst of several friction scales and loads."""
