"""What the four packages share: compiled kernels and their cache, checks of values, the registry, former names."""
