from . import cars, chassis, plant, road, steering, suspension, tyre

__all__ = ["cars", "chassis", "plant", "road", "steering", "suspension", "tyre"]
