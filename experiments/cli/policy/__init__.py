"""Evaluate policies and baselines, record them, and test their stability."""

GROUP = "learn"
