"""Writing results: files, provenance, metrics as JSON, options that several commands share."""
