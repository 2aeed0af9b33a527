"""What manoeuvres share: their declaration, shapes of handwheel motion, and the simulation of one."""
