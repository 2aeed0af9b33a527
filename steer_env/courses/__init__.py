"""Courses that a car is driven along: paths, and the cones of ISO 3888."""
