"""The rows that all groups of requirements print."""
