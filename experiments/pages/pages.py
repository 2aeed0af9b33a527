"""Pages as HTML from templates; ``templates`` in this folder holds the style sheet that all pages share."""

from urllib.parse import quote

import jinja2
from markupsafe import Markup

from steer_env.experiments.pages import words
from steer_env.experiments.pages.small_svg import smaller


def environment(package: str) -> jinja2.Environment:
    """The templates of a package, with the shared style sheet and the filters for numbers and names."""
    packages = (package, "steer_env.experiments.pages")
    found = jinja2.Environment(
        loader=jinja2.ChoiceLoader([jinja2.PackageLoader(name) for name in packages]),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    filters = (
        words.number,
        words.percent,
        words.change,
        words.label,
        words.unit,
        words.prose,
        words.span,
        words.plain,
        words.within,
    )
    found.filters |= {f.__name__: f for f in filters}
    return found


# Characters that may stand in a quoted attribute of HTML and in an address of data as they are.
_KEPT = " !$'()*+,-./:;<=>?@[]^_`{|}~"


def image(svg: str) -> Markup:
    """A picture as the source of an image, which needs no other file."""
    return Markup("data:image/svg+xml," + quote(smaller(svg), safe=_KEPT))
