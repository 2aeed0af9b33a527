"""Kinds of steering whose car file has quantities of its own, one file each; ``column_eps`` needs none."""
