"""The car: tyre, strut, column, assist, chassis, and the plant that couples them."""

from vehicle import cars, plant, suspension, tyre

__all__ = ["cars", "plant", "suspension", "tyre"]
