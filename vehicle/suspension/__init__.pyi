from .macpherson import MacPherson, Motion, Pose, WheelLoad, available, load_coefficients, mirrored, rack_force

__all__ = ["MacPherson", "Motion", "Pose", "WheelLoad", "available", "load_coefficients", "mirrored", "rack_force"]
