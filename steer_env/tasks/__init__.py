"""Tasks of the environments; importing the package registers them."""

from steer_env.tasks import lane_change, lane_keeping, parking, release, weave  # noqa: F401 (they register themselves)
from steer_env.tasks.definition import Case, Quantity, Setting, Task, available, register, task

__all__ = ["Case", "Quantity", "Setting", "Task", "available", "register", "task"]
