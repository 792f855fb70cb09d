# SPDX-License-Identifier: Apache-2.0
"""Small changes of a Python source that its tests should notice: one operator, number, condition or statement each."""

import ast
from collections.abc import Iterator
from typing import NamedTuple

_OPERATORS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.FloorDiv: ("//", "*"),
    ast.Mod: ("%", "*"),
    ast.Pow: ("**", "*"),
    ast.LShift: ("<<", ">>"),
    ast.RShift: (">>", "<<"),
    ast.BitAnd: ("&", "|"),
    ast.BitOr: ("|", "&"),
    ast.BitXor: ("^", "&"),
    ast.And: ("and", "or"),
    ast.Or: ("or", "and"),
}
_COMPARISONS: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
    ast.In: ("in", "not in"),
    ast.NotIn: ("not in", "in"),
}
# What a statement does that can be left out without an unknown name.
_DROPPED = (ast.Expr, ast.AugAssign, ast.Raise, ast.Continue, ast.Break)


class Mutation(NamedTuple):
    """Replacement of a piece of a source, given as offsets into its UTF-8 bytes."""

    kind: str
    line: int  # first one, from 1
    start: int
    end: int
    text: str

    def applied(self, source: bytes) -> bytes:
        """The source with the change made."""
        return source[: self.start] + self.text.encode() + source[self.end :]


def mutations(source: bytes) -> list[Mutation]:
    """All changes of a source, in the order of their places; those of documentation, types and names are none."""
    finder = _Finder(source)
    finder.visit(ast.parse(source))
    return sorted(set(finder.found), key=lambda m: (m.start, m.end, m.text))


class _Finder(ast.NodeVisitor):
    """Walks the tree of a source."""

    def __init__(self, source: bytes) -> None:
        self.found: list[Mutation] = []
        self._source = source
        self._starts = [0]
        for line in source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))

    def _span(self, node: ast.AST) -> tuple[int, int]:
        first, last = node.lineno, node.end_lineno  # type: ignore[attr-defined]
        start = self._starts[first - 1] + node.col_offset  # type: ignore[attr-defined]
        return start, self._starts[last - 1] + node.end_col_offset  # type: ignore[attr-defined]

    def _text(self, node: ast.AST) -> str:
        start, end = self._span(node)
        return self._source[start:end].decode()

    def _add(self, kind: str, start: int, end: int, text: str) -> None:
        self.found.append(Mutation(kind, self._source.count(b"\n", 0, start) + 1, start, end, text))

    def _swap(self, kind: str, left: ast.AST, right: ast.AST, old: str, new: str) -> None:
        """Replaces an operator that stands between two nodes."""
        start, end = self._span(left)[1], self._span(right)[0]
        between = self._source[start:end]
        at = between.find(old.encode())
        if at >= 0 and b"#" not in between:
            self._add(kind, start + at, start + at + len(old), new)

    def _negate(self, test: ast.expr) -> None:
        if not (isinstance(test, ast.Name) and test.id == "TYPE_CHECKING"):
            self._add("condition negated", *self._span(test), f"(not ({self._text(test)}))")

    # statements

    def visit_body(self, statements: list[ast.stmt]) -> None:
        """Statements of a block, and each left out where that leaves valid code."""
        for statement in statements:
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                continue  # documentation
            if isinstance(statement, _DROPPED) or _names_nothing(statement):
                self._add("statement dropped", *self._span(statement), "pass")
            self.visit(statement)

    def generic_visit(self, node: ast.AST) -> None:
        for field, value in ast.iter_fields(node):
            if field in ("body", "orelse", "finalbody") and isinstance(value, list):
                self.visit_body(value)
            elif isinstance(value, list):
                for item in value:
                    if isinstance(item, ast.AST):
                        self.visit(item)
            elif isinstance(value, ast.AST):
                self.visit(value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for default in (*node.args.defaults, *filter(None, node.args.kw_defaults)):
            self.visit(default)
        self.visit_body(node.body)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self.visit_body(node.body)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        if self._text(node.test).startswith("__name__"):
            return
        self._negate(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        self._negate(node.test)
        self.generic_visit(node)

    def visit_Assert(self, node: ast.Assert) -> None:
        """Says what is so; nothing depends on it."""

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        if type(node.op) in _OPERATORS:
            old, new = _OPERATORS[type(node.op)]
            self._swap("operator swapped", node.target, node.value, f"{old}=", f"{new}=")
        self.generic_visit(node)

    # expressions

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._negate(node.test)
        for part in (node.test, node.body, node.orelse):
            self.visit(part)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        text = isinstance(node.left, ast.JoinedStr) or isinstance(getattr(node.left, "value", None), str)
        if type(node.op) in _OPERATORS and not text:
            self._swap("operator swapped", node.left, node.right, *_OPERATORS[type(node.op)])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        for left, right in zip(node.values, node.values[1:], strict=False):
            self._swap("operator swapped", left, right, *_OPERATORS[type(node.op)])
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        start, end = self._span(node)
        if isinstance(node.op, ast.USub):
            self._add("sign changed", start, end, f"({self._text(node.operand)})")
        elif isinstance(node.op, ast.Not):
            self._add("condition negated", start, end, f"({self._text(node.operand)})")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        sides = [node.left, *node.comparators]
        for operator, left, right in zip(node.ops, sides, sides[1:], strict=False):
            self._swap("comparison moved", left, right, *_COMPARISONS[type(operator)])
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self.visit(node.value)
        index = node.slice
        if isinstance(index, ast.Constant) and type(index.value) is int:
            shifted = index.value - 1 if index.value > 0 else 1
            self._add("index shifted", *self._span(index), str(shifted))
        else:
            self.visit(index)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._add("constant changed", *self._span(node), str(not value))
        elif isinstance(value, int):
            self._add("constant changed", *self._span(node), str(value + 1))
        elif isinstance(value, float):
            self._add("constant changed", *self._span(node), repr(2.0 * value if value else 1.0))

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Words for people, whose places Python 3.11 does not tell."""


def _names_nothing(statement: ast.stmt) -> bool:
    """Whether a statement assigns to attributes and elements alone."""
    return isinstance(statement, ast.Assign) and not any(
        isinstance(part, ast.Name) for target in statement.targets for part in _parts(target)
    )


def _parts(target: ast.expr) -> Iterator[ast.expr]:
    if isinstance(target, (ast.Tuple, ast.List)):
        for element in target.elts:
            yield from _parts(element)
    else:
        yield target
