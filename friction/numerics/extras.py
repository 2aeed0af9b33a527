"""Advice on the optional packages of an extra, as it works where it is printed."""

from pathlib import Path


def install(extra: str) -> str:
    """The command that installs an extra: from the checkout that runs, or of the package that is installed.

    ``pip install 'steer-env[...]'`` finds the installed package and adds what the extra brings, without an index that
    has the package.
    """
    root = Path(__file__).parents[3]  # of steer_env/friction/numerics
    if not (root / "pyproject.toml").is_file():
        return f"pip install 'steer-env[{extra}]'"
    return f"pip install '{'.' if root == Path.cwd() else root}[{extra}]'"
