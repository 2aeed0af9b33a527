"""What devices share: the protocol, axes, the events of pygame, and the model of a wheel."""
