"""The command line ``steer-env``: one file for each command, ``common`` for what they share."""
