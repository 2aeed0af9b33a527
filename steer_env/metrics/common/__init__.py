"""What the evaluations share: the declaration of metrics, filtered channels, events, spectra and intervals."""
