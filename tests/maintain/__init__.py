"""What maintainers run from a checkout, one file a command: ``python -m tests.maintain COMMAND``."""
