"""What driver models share: arms and muscles, the batch of drivers, linear-quadratic preview gains."""
