"""Studies, one file each with ``main(argv)``, which ``steer-env study`` runs; ``common`` holds what they share."""
