# SPDX-License-Identifier: Apache-2.0
"""What is said of fields where they are declared: the parameter that one is made of, or the comment on its line."""

import ast
import inspect
import io
import sys
import tokenize
from collections.abc import Callable, Iterator
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from css_common.schema import Table
from css_export.sole_parameter import as_it_stands, conversion


def comments_of(source: Any) -> Callable[[str], str]:
    """What is said of the fields of a NamedTuple class or of a structured dtype, by name; "" where nothing is."""
    told = _of_dtype(source) if isinstance(source, np.dtype) else _of_class(source)
    return lambda name: told.get(name, "")


@cache
def _of_class(source: type) -> dict[str, str]:
    told: dict[str, str] = {}
    for kind in reversed(source.__mro__):
        module = sys.modules.get(kind.__module__)
        if module is None or not hasattr(kind, "_fields"):
            continue
        for node in ast.walk(_tree(module)):
            if isinstance(node, ast.ClassDef) and node.name == kind.__name__:
                told |= dict(_annotated(node, _line_comments(module)))
    for name, made_of in getattr(source, "_field_defaults", {}).items():
        words = _of_parameter(made_of)
        if words and name not in told:
            told[name] = words
    return told


def _of_parameter(source: Any) -> str:
    """What is said of the one parameter that a field is made of; "" where there are several or none."""
    table: Table = getattr(source, "table", ())
    if len(table) != 1:
        return ""
    (parameter,) = table
    if as_it_stands(source):
        return f"[{parameter.unit}] {parameter.description}"
    made, named = conversion(source), f"{parameter.name} [{parameter.unit}]: {parameter.description}"
    if made is None:
        return f"made of {named}"
    return f"[{made.unit}] {'square of ' if made.power == 2 else ''}{named}"


def _annotated(node: ast.ClassDef, comments: dict[int, str]) -> Iterator[tuple[str, str]]:
    for part in node.body:
        if isinstance(part, ast.AnnAssign) and isinstance(part.target, ast.Name):
            lines = range(part.lineno, (part.end_lineno or part.lineno) + 1)
            told = " ".join(comments[line] for line in lines if line in comments)
            if told:
                yield part.target.id, told


def _of_dtype(source: np.dtype) -> dict[str, str]:
    names = set(source.names or ())
    for module in list(sys.modules.values()):
        if not isinstance(module, ModuleType) or not getattr(module, "__name__", "").startswith(("css_", "sunpoint_")):
            continue
        if any(value is source for value in vars(module).values()):
            comments = _line_comments(module)
            told = {
                node.value: comments[node.lineno]
                for node in ast.walk(_tree(module))
                if isinstance(node, ast.Constant) and node.value in names and node.lineno in comments
            }
            if told:
                return told
    return {}


@cache
def _tree(module: ModuleType) -> ast.Module:
    return ast.parse(_text(module))


@cache
def _text(module: ModuleType) -> str:
    try:
        return inspect.getsource(module)
    except OSError:
        return ""


@cache
def _line_comments(module: ModuleType) -> dict[int, str]:
    tokens = tokenize.generate_tokens(io.StringIO(_text(module)).readline)
    marks = ("noqa", "type:")
    return {
        token.start[0]: token.string.lstrip("# ").strip()
        for token in tokens
        if token.type == tokenize.COMMENT and not token.string.lstrip("# ").startswith(marks)
    }
