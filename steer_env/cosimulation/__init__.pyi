from .client import Client
from .describe import describe
from .packets import Layout, layout_of
from .server import Server

__all__ = ["Client", "Layout", "Server", "describe", "layout_of"]
