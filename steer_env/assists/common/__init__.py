"""What baseline assist controllers share."""
