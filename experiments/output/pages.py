"""Pages as HTML from templates; ``templates`` in this folder holds the style sheet that all pages share."""

from base64 import b64encode

import jinja2

from steer_env.experiments.output import words


def environment(package: str) -> jinja2.Environment:
    """The templates of a package, with the shared style sheet and the filters for numbers and names."""
    packages = (package, "steer_env.experiments.output")
    found = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(name) for name in packages]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    found.filters |= {f.__name__: f for f in (words.number, words.percent, words.change, words.label)}
    return found


def image(svg: str) -> str:
    """A picture as the source of an image, which needs no other file."""
    return "data:image/svg+xml;base64," + b64encode(svg.encode()).decode()
