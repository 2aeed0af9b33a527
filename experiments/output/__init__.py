"""Writing results: atomic output, provenance, JSON, templates, numbers in words, progress."""
