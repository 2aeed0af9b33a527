"""What the studies, the report and the command line share."""
