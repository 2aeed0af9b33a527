"""Pictures of an environment: the car on its road, the handwheel, the live torque-angle loop."""
