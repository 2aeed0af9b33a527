"""Configuration of Sphinx for the site; tests/tools/site.py gathers its sources and builds it."""

from importlib import import_module, metadata

from docutils import nodes

from tests.tools.site import mathml
from tests.tools.site_pages import meanings

project, author = "steer-env", "The steer-env authors"
project_copyright = author
version = release = metadata.version("steer-env")
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_heading_anchors = 6  # links to headings, as code hosts make them
myst_fence_as_directive = ["math"]  # ```math and $`...`$, as code hosts mark them
myst_enable_extensions = ["dollarmath"]
myst_dmath_allow_space = myst_dmath_allow_digits = False  # prose and shells have the sign too
highlight_language = "text"
autodoc_mock_imports = ["stable_baselines3", "torch"]  # of the extra `train`
autodoc_member_order = "bysource"
toc_object_entries = False  # the sidebar of every page would hold every name
autodoc_typehints_format = "short"
python_use_unqualified_type_names = True
maximum_signature_line_length = 80
napoleon_google_docstring = napoleon_use_param = napoleon_use_rtype = False
nitpick_ignore_regex = [("py:.*", ".*")]  # docstrings name types of other libraries, and what is not public

html_math_renderer = "mathml"
html_theme = "furo"
html_title = f"steer-env {release}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_search_summary = False  # a page that is opened from disk cannot read the others


def _prepare(app, what, name, thing, options, lines):
    """Docstrings as reStructuredText, in which ``|v_x|`` is a substitution; fields have the comment at their line."""
    if lines and lines[0].startswith("Alias for field number"):
        owner, _, field = name.rpartition(".")
        module, _, kind = owner.rpartition(".")
        lines[:] = [meanings(getattr(import_module(module), kind), units=True).get(field, "")]
    lines[:] = [line if "``" in line else line.replace("|", "\\|") for line in lines]


def _inline(writer, node):
    writer.body.append(mathml(node.astext(), block=False))
    raise nodes.SkipNode


def _block(writer, node):
    writer.body.append(f'<div class="math">{mathml(node.astext(), block=True)}</div>')
    raise nodes.SkipNode


def setup(app):
    """Prepare docstrings after napoleon, to which a colon in the comment of a field would mean a type."""
    app.connect("autodoc-process-docstring", _prepare, priority=600)
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
