from .common.definition import Quantity, Task, available, register, task

__all__ = ["Quantity", "Task", "available", "register", "task"]
