"""Pictures as SVG, and interactive plots as HTML."""
