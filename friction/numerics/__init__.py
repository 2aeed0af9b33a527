"""What the four packages share: compilation of kernels, checks of values, bounds, the registry, TOML."""
