from .writing import explore

__all__ = ["explore"]
