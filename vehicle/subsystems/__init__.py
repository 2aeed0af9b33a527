"""What advances sample by sample with named inputs, outputs, parameters and state: car, steering and chassis."""
