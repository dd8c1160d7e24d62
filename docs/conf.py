"""The site of this folder, README and CHANGELOG, by Sphinx: ``make docs``. Nothing in it needs a network.

Sphinx and not MkDocs, as it reads docstrings by itself, takes any broken link or heading for an error, and
can have README.md as a page where it is. Formulas become MathML by docutils, which every present browser
draws by itself: no script and no font has to be fetched or bundled.
"""

import re
import sys
from pathlib import Path

from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

from hexacell import __version__

sys.path.insert(0, str(Path(__file__).parents[1]))

project = "hexacell"
version = release = __version__
copyright = "2026, the hexacell project"  # noqa: A001 - Sphinx's name for it

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
include_patterns = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md", "docs/*.md"]
exclude_patterns = [".*", "build", "configs", "dist", "drivers", "hexacell", "procedures", "runs", "tests"]
root_doc = "docs/index"

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # as GitHub has them
myst_heading_anchors = 4

napoleon_use_ivar = True
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
python_use_unqualified_type_names = True
toc_object_entries = False
nitpicky = True
nitpick_ignore_regex = [  # only what a page documents can be linked to
    ("py:.*", r"(?!(hexacell\.(api|errors)|drivers\.(interfaces|errors))\.).*"),
    ("py:.*", r".*\.(Identity_co|Device)"),
]

html_theme = "furo"
html_title = "hexacell"
html_theme_options = {
    "sidebar_hide_name": False,
    "light_css_variables": {
        "color-brand-primary": "#0b5a8a",
        "color-brand-content": "#0b5a8a",
        "font-stack": "system-ui, 'Noto Sans', 'DejaVu Sans', sans-serif",
        "font-stack--monospace": "'DejaVu Sans Mono', 'Noto Sans Mono', monospace",
    },
    "dark_css_variables": {"color-brand-primary": "#7cc4f0", "color-brand-content": "#7cc4f0"},
}
html_static_path = ["_site/static"]
html_extra_path = ["_site/root"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_show_sourcelink = False
html_copy_source = False


def mathml(node: nodes.math | nodes.math_block, *, as_block: bool) -> str:
    """A formula as MathML; one that is wrong is told with its place."""
    try:
        return latex2mathml.tex2mathml(node.astext(), as_block=as_block)
    except latex2mathml.MathError as error:
        logging.getLogger(__name__).warning("formula: %s", error, location=node)
        return node.astext()


def formula_in_text(translator: HTML5Translator, node: nodes.math) -> None:
    """A formula within a line."""
    translator.body.append(mathml(node, as_block=False))
    raise nodes.SkipNode


def formula_block(translator: HTML5Translator, node: nodes.math_block) -> None:
    """A formula in lines of its own."""
    translator.body.append(f'<div class="formula">{mathml(node, as_block=True)}</div>\n')
    raise nodes.SkipNode


def pages_of_sections(_app: Sphinx, name: str, source: list[str]) -> None:
    """Make the menu of the lists of links on the first page, which stays plain Markdown that way."""
    if name != root_doc:
        return
    for section in source[0].split("\n## ")[1:]:
        links = re.findall(r"^- \[(.+)\]\((.+)\.md\)$", section, flags=re.MULTILINE)
        pages = [f"{title} <{link}>" for title, link in links]
        caption = f":caption: {section.splitlines()[0]}"
        source[0] += "\n".join(["", "```{toctree}", ":hidden:", caption, "", *pages, "```", ""])


def generated_parts(_app: Sphinx, _name: str, source: list[str]) -> None:
    """Put the parts of a page that are made from the program in their places."""
    if "<!-- made from the program" in source[0]:
        from docs.generated import page_with_generated_parts  # noqa: PLC0415 - only for pages that have any

        source[0] = page_with_generated_parts(source[0])


def setup(app: Sphinx) -> None:
    """Add formulas, the menu and the generated parts."""
    app.add_html_math_renderer("mathml", (formula_in_text, None), (formula_block, None))
    app.connect("source-read", pages_of_sections)
    app.connect("source-read", generated_parts)
