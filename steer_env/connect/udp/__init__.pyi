from .client import Client, Stream
from .describe import describe
from .packets import Layout, layout_of
from .server import Server

__all__ = ["Client", "Layout", "Server", "Stream", "describe", "layout_of"]
