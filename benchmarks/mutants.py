"""Mutants of Python source: small changes, each of which a test should notice.

A mutant replaces the text of one node of the syntax tree and leaves the rest of the file as it is.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_BINARY = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "*", ast.Pow: "*",
    ast.BitAnd: "|", ast.BitOr: "&", ast.LShift: ">>", ast.RShift: "<<", ast.MatMult: "*",
}  # fmt: skip
_COMPARE = {
    ast.Lt: ("<=", ">="), ast.LtE: ("<", ">"), ast.Gt: (">=", "<="), ast.GtE: (">", "<"), ast.Eq: ("!=",),
    ast.NotEq: ("==",), ast.Is: ("is not",), ast.IsNot: ("is",), ast.In: ("not in",), ast.NotIn: ("in",),
}  # fmt: skip
#: Nodes without mutants: texts and messages, and what only a type checker or a reader uses.
_SKIPPED = (ast.Raise, ast.JoinedStr, ast.Import, ast.ImportFrom, ast.Assert)
#: Calls whose effect is a message or a type.
_SKIPPED_CALLS = ("print", "TypeVar", "cast", "debug", "info", "warning", "overload")


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """A change of one piece of text of one file.

    Attributes:
        path: The file, relative to the root of the repository.
        start: Position of the text in the file [characters].
        line: Line of that position, counted from 1.
        before: The text that is replaced.
        after: The text that replaces it.
        lines: Lines of the statement, any of which a test must run to notice the change.
        owner: Name of the function, class or constant that the text is part of.
        runs: Whether the text is inside a function; otherwise it runs at the import of the file.
    """

    path: str
    start: int
    line: int
    before: str
    after: str
    lines: tuple[int, ...]
    owner: str
    runs: bool

    def apply(self, source: str) -> str:
        """Return the source with the change."""
        end = self.start + len(self.before)
        if source[self.start : end] != self.before:
            message = f"{self.path}: the source has changed at line {self.line}"
            raise ValueError(message)
        return source[: self.start] + self.after + source[end:]


class _Finder:
    """Finds the mutants of one source."""

    def __init__(self, path: str, source: str) -> None:
        self.path, self.source = path, source
        text = source.splitlines(keepends=True)
        self._starts = [0]
        for line in text:
            self._starts.append(self._starts[-1] + len(line))
        self._text = text

    def _position(self, line: int, column: int) -> int:
        """Position in characters of a column, which `ast` counts in bytes."""
        return self._starts[line - 1] + len(self._text[line - 1].encode()[:column].decode())

    def _span(self, node: ast.expr | ast.stmt | ast.keyword) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._position(node.lineno, node.col_offset), self._position(node.end_lineno, node.end_col_offset)

    def _piece(self, node: ast.expr | ast.stmt | ast.keyword) -> str:
        start, end = self._span(node)
        return self.source[start:end]

    def _between(self, left: ast.expr, right: ast.expr, old: str, new: str) -> tuple[int, str, str] | None:
        """Change of an operator between two operands, parentheses around them included."""
        start, end = self._span(left)[1], self._span(right)[0]
        found = self.source.find(old, start, end)
        return (found, old, new) if found >= 0 else None

    def changes(  # noqa: C901, PLR0912 -- a case per kind of node
        self, node: ast.AST
    ) -> Iterator[tuple[int, str, str] | None]:
        """Yield position, text before and text after of the mutants of one node."""
        match node:
            case ast.Constant(value=bool(value)):
                yield self._span(node)[0], str(value), str(not value)
            case ast.Constant(value=int() | float()):
                yield self._span(node)[0], self._piece(node), f"({self._piece(node)} + 1)"
            case ast.BinOp(op=op) if type(op) in _BINARY:
                old = ast.unparse(ast.BinOp(ast.Name("a"), op, ast.Name("b")))[1:-1].strip()
                yield self._between(node.left, node.right, old, _BINARY[type(op)])
            case ast.AugAssign(op=op) if type(op) in _BINARY:
                old = ast.unparse(ast.BinOp(ast.Name("a"), op, ast.Name("b")))[1:-1].strip() + "="
                yield self._between(node.target, node.value, old, _BINARY[type(op)] + "=")
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                old = ast.unparse(ast.Compare(ast.Name("a"), [op], [ast.Name("b")]))[1:-1].strip()
                for new in _COMPARE[type(op)]:
                    yield self._between(left, right, old, new)
            case ast.BoolOp(op=op, values=[left, right, *_]):
                old, new = ("and", "or") if isinstance(op, ast.And) else ("or", "and")
                yield self._between(left, right, old, new)
            case ast.UnaryOp(op=ast.Not() | ast.USub() | ast.Invert(), operand=operand):
                yield self._span(node)[0], self._piece(node), f"({self._piece(operand)})"
            case ast.IfExp(test=test) | ast.If(test=test) | ast.While(test=test):
                if isinstance(test, ast.Name | ast.Attribute | ast.Call):
                    yield self._span(test)[0], self._piece(test), f"(not {self._piece(test)})"
            case ast.Call():
                yield from self._change_call(node)
            case ast.Break() | ast.Continue():
                old = self._piece(node)
                yield self._span(node)[0], old, "continue" if old == "break" else "break"
            case ast.Expr(value=ast.Call()):
                yield self._span(node)[0], self._piece(node), "pass"

    def _change_call(self, node: ast.Call) -> Iterator[tuple[int, str, str]]:
        """Exchange the first two arguments, and drop each keyword."""
        match node.args:
            case [ast.Name() | ast.Attribute() as first, ast.Name() | ast.Attribute() as second, *_]:
                start, end = self._span(first)[0], self._span(second)[1]
                comma = self.source[self._span(first)[1] : self._span(second)[0]]
                yield start, self.source[start:end], self._piece(second) + comma + self._piece(first)
        for keyword in node.keywords:
            if keyword.arg not in (None, "strict"):
                start, end = self._span(keyword)
                rest = self.source[end:]
                blank = len(rest) - len(rest.lstrip())
                end += blank + 1 if rest[blank] == "," else 0
                yield start, self.source[start:end], ""

    def mutants(  # noqa: C901, PLR0912 -- a case per kind of node
        self, node: ast.AST, owner: str, lines: tuple[int, ...], *, runs: bool = False
    ) -> Iterator[Mutant]:
        """Yield the mutants of a node and of what it holds."""
        if isinstance(node, _SKIPPED) or _is_text(node) or _is_for_types(node):
            return
        if isinstance(node, ast.stmt) and not isinstance(node, ast.FunctionDef | ast.ClassDef):
            body = getattr(node, "body", None)
            last = body[0].lineno - 1 if body else node.end_lineno
            lines = tuple(range(node.lineno, max(node.lineno, last or 0) + 1))
        for change in self.changes(node):
            if change is not None and change[1] != change[2]:
                line = self.source.count("\n", 0, change[0]) + 1
                yield Mutant(path=self.path, start=change[0], line=line, before=change[1], after=change[2],
                             lines=lines, owner=owner, runs=runs)  # fmt: skip
        match node:
            case ast.FunctionDef(name=name, body=[first, *_]):
                owner, runs, lines = name, True, tuple(range(first.lineno, (node.end_lineno or 0) + 1))
            case ast.ClassDef(name=name):
                owner = owner if runs else name
            case ast.Assign(targets=[ast.Name(id=name)]) | ast.AnnAssign(target=ast.Name(id=name)):
                owner = owner or name
            case ast.Assign(targets=[ast.Tuple(elts=names)], value=ast.Tuple(elts=values)) if not owner:
                for target, value in zip(names, values, strict=True):
                    yield from self.mutants(value, ast.unparse(target), lines, runs=runs)
                return
        for name, value in ast.iter_fields(node):
            if name not in ("annotation", "returns", "decorator_list", "type_params"):
                for child in value if isinstance(value, list) else [value]:
                    if isinstance(child, ast.AST):
                        yield from self.mutants(child, owner, lines, runs=runs)


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _is_for_types(node: ast.AST) -> bool:
    """Whether a node holds nothing that runs: types, messages, lists of public names."""
    match node:
        case ast.If(test=ast.Name(id="TYPE_CHECKING")):
            return True
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name in _SKIPPED_CALLS
        case ast.Assign(targets=[ast.Name(id=name)]):
            return name == "__all__"
        case ast.keyword(arg="strict"):  # of `zip`: a guard against what does not happen
            return True
    return False


def find_mutants(root: Path, packages: tuple[str, ...]) -> list[Mutant]:
    """Find all mutants of packages, in the order of files and lines.

    Args:
        root: Root of the repository.
        packages: Names of the packages.
    """
    found = []
    for file in sorted(file for package in packages for file in (root / package).rglob("*.py")):
        source = file.read_text()
        finder = _Finder(file.relative_to(root).as_posix(), source)
        found += list(finder.mutants(ast.parse(source), "", ()))
    return found
