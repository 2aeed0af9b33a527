"""What steps many environments at once: arrays and kernels of a batch, its state, infos and specification."""
