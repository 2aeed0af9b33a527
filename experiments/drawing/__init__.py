"""Figures as SVG and interactive plots."""
