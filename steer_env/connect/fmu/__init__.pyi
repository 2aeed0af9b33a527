from .exporter import export
from .firmware import export_object

__all__ = ["export", "export_object"]
