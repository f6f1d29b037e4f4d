"""Configuration of Sphinx, which builds the documentation site from the pages in docs/ unchanged: `make docs`.

The pages are plain Markdown with relative links, so that they read the same in the repository. The additions of the
site are made here: the navigation (navigation.py), the pictures of the gallery (gallery.py) and the Python reference
(python_api.py). Nothing is downloaded: scripts, fonts and the search index are files of the site.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

from pliant import __version__

project = "Pliant"
author = "The Pliant authors"
copyright = "The Pliant authors, Apache-2.0"
version = release = __version__
root_doc = "docs/index"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "navigation",
    "gallery",
    "python_api",
]
# The source directory is the repository: pages link to examples and to packages outside docs/.
include_patterns = [
    "docs/**.md",
    "docs/python/*.rst",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "examples/*/README.md",
    "contrib/*/README.md",
]
exclude_patterns = [".*", "build", "core", "plugins", "tests", "benchmarks", "runs", "**/src", "**/runs"]

myst_heading_anchors = 4
suppress_warnings = ["myst.header"]  # generated pages may skip a level of headings
default_role = "code"  # docstrings write `name`, as Markdown does
smartquotes = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_type_aliases = {"Array": "Array"}  # an array of floats; shapes are in the text
autodoc_default_options = {"members": True}
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_maximum_signature_line_length = 88
copybutton_prompt_text = "$ "  # a console block is copied without prompts and output

html_theme = "pydata_sphinx_theme"
html_title = "Pliant"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_extra_path = ["index.html"]  # redirects from the root of the site to docs/index.html
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "header_links_before_dropdown": 6,
    "navbar_align": "left",
    "navbar_persistent": ["search-button-field"],
    "navbar_end": ["theme-switcher"],
    "article_header_start": ["breadcrumbs"],
    "show_toc_level": 2,
    "secondary_sidebar_items": {"**": ["page-toc"], "docs/pictures/README": []},
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "tango",
    "pygments_dark_style": "monokai",
}


def setup(app: Sphinx) -> None:
    """Make Sphinx treat tables of measurements as plain text in its highlighter."""
    app.add_lexer("csv", TextLexer)
