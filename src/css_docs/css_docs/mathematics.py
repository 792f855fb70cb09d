# SPDX-License-Identifier: Apache-2.0
"""Equations as MathML, made when the site is built: browsers set it themselves, without a script or a font to load."""

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util import logging

NAME = "mathml"
_log = logging.getLogger(__name__)


def setup(app: Sphinx) -> dict[str, Any]:
    """Tells Sphinx of this renderer (`html_math_renderer`)."""
    app.add_html_math_renderer(NAME, (_inline, _nothing), (_block, _nothing))
    app.connect("doctree-resolved", _set_all)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def mathml(latex: str, display: str) -> str:
    """MathML of an equation.

    Args:
        latex: as between dollars.
        display: `inline` or `block`.

    Raises:
        ValueError: it cannot be set, or has a command that is not known.
    """
    try:
        made = convert(latex, display=display)
    except Exception as error:  # the converter has a dozen kinds of its own, without a common one
        raise ValueError(f"{type(error).__name__} in the equation {latex!r}") from error
    if "\\" in made:
        raise ValueError(f"{made[made.index(chr(92)) :].split('<')[0]} is not known, in the equation {latex!r}")
    return made


def _set_all(app: Sphinx, doctree: nodes.document, name: str) -> None:
    """Sets all equations of a page, whatever is built: what cannot be set is a warning of every build."""
    for kind, display in ((nodes.math, "inline"), (nodes.math_block, "block")):
        for node in doctree.findall(kind):
            try:
                node[NAME] = mathml(node.astext(), display)
            except ValueError as error:
                _log.warning("%s", error, location=node)


def _inline(writer: Any, node: nodes.Element) -> None:
    writer.body.append(node.get(NAME, ""))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.Element) -> None:
    writer.body.append(f'<div class="math">{node.get(NAME, "")}</div>\n')
    raise nodes.SkipNode


def _nothing(writer: Any, node: nodes.Node) -> None:
    """Nothing is left to close."""
