"""Parameters of a friction law from a record of displacement and torque; one module for each part of the task."""
