"""What a feel by wire resists with beside damping and wanted friction, one file each."""
