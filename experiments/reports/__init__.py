"""The evaluation report, the assessment of recordings, and the generated pages of the documentation."""
