"""What the manoeuvres share: their declaration, shapes of handwheel motion, and their simulation."""
