"""The requirements with their measured values, and the independent calculations that they are compared with."""
