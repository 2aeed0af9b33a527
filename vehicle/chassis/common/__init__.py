"""The two chassis models, one file or folder each, and what they share."""
