"""What metrics share: their declaration, filtered channels, events, spectra, intervals."""
