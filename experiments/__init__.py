"""Studies, the report and the command line."""
