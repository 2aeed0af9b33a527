"""What the four packages share: compiled kernels and their cache, checks of values and the registry."""
