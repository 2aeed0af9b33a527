"""Tuning scenarios, one file each: which tests a parameter set is driven through."""
