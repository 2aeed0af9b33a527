from .unit_export import export

__all__ = ["export"]
