"""The mutants of a Python source: each differs from it in one small place.

Comparisons, arithmetic, numbers, boolean operators and conditions, returned values, statements and the order of arguments
are changed. Texts, docstrings, annotations and decorators are left alone: no test should depend on them. So is the order of
two arguments where it makes no difference, as in `max(a, b)`; for NaN it would, but no core relies on that.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}

SYMMETRIC = {"min", "max", "np.minimum", "np.maximum", "hypot"}
"""Functions whose result does not depend on the order of two numbers."""


@dataclass(frozen=True)
class Mutant:
    """A source with one change."""

    kind: str
    line: int
    column: int
    before: str
    after: str
    lines: frozenset[int]
    """Lines of the changed code and of the statement that it is in; of a statement with a block, those of its head."""
    source: str
    """The whole changed source."""


def mutants_of(source: str) -> list[Mutant]:
    """All mutants of a source, in the order of their places."""
    data = source.encode()
    starts = [0]
    for row in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(row))
    found: list[Mutant] = []
    for node, statement in _changeable(ast.parse(source)):
        for kind, changed in _changes(node):
            begin = starts[node.lineno - 1] + node.col_offset
            end = starts[(node.end_lineno or node.lineno) - 1] + (node.end_col_offset or 0)
            text = ast.unparse(changed)
            after = text if isinstance(node, ast.stmt) else f"({text})"
            mutated = (data[:begin] + after.encode() + data[end:]).decode()
            before, lines = data[begin:end].decode(), frozenset({*_lines(node), *_lines(statement)})
            found.append(Mutant(kind, node.lineno, node.col_offset, before, text, lines, mutated))
    return sorted(found, key=lambda each: (each.line, each.column, each.kind, each.after))


def _changeable(tree: ast.AST, statement: ast.stmt | None = None) -> Iterator[tuple[ast.stmt | ast.expr, ast.stmt]]:
    """Every statement without a block and every expression that is not part of a text, an annotation or a decorator, and the innermost
    statement that it is in."""
    for name, value in ast.iter_fields(tree):
        if name in ("annotation", "returns", "decorator_list", "type_params", "bases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.JoinedStr | ast.Import | ast.ImportFrom):
                continue
            inner = child if isinstance(child, ast.stmt) else statement
            if isinstance(child, ast.stmt | ast.expr) and inner and not _has_block(child):
                yield child, inner
            yield from _changeable(child, inner)


def _has_block(node: ast.AST) -> bool:
    return isinstance(node, ast.stmt) and (hasattr(node, "body") or hasattr(node, "cases"))


def _lines(node: ast.stmt | ast.expr) -> range:
    """The lines of an expression or a statement; of one with a block, those before it."""
    if not _has_block(node):
        return range(node.lineno, (node.end_lineno or node.lineno) + 1)
    block: list[ast.stmt] | list[ast.match_case] = getattr(node, "cases", None) or getattr(node, "body", [])
    inside = block[0].pattern if isinstance(block[0], ast.match_case) else block[0]
    return range(node.lineno, max(node.lineno + 1, inside.lineno))


def _changes(node: ast.stmt | ast.expr) -> Iterator[tuple[str, ast.AST]]:
    """The changes of one node, and their kinds."""
    changed = copy.deepcopy(node)
    match changed:
        case ast.Compare(ops=[op]):
            changed.ops = [COMPARISONS[type(op)]()]
            yield "comparison", changed
        case ast.BinOp(op=op) if type(op) in ARITHMETIC:
            changed.op = ARITHMETIC[type(op)]()
            yield "arithmetic", changed
        case ast.AugAssign(op=op) if type(op) in ARITHMETIC:
            changed.op = ARITHMETIC[type(op)]()
            yield "arithmetic", changed
            yield "statement", ast.Pass()
        case ast.Constant(value=bool(value)):
            yield "constant", ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield "constant", ast.Constant(value + 1)
            yield "constant", ast.UnaryOp(ast.USub(), ast.Constant(1)) if value == 0 else ast.Constant(value - 1)
        case ast.Constant(value=float(value)):
            yield "constant", ast.Constant(value * 1.25 if value else 1.0)
        case ast.BoolOp(op=op):
            changed.op = ast.Or() if isinstance(op, ast.And) else ast.And()
            yield "boolean", changed
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield "boolean" if isinstance(changed.op, ast.Not) else "arithmetic", operand
        case ast.IfExp(test=test):
            changed.test = ast.UnaryOp(ast.Not(), test)
            yield "boolean", changed
        case ast.Return(value=ast.expr() as value) if not _is_none(value):
            yield "return", ast.Return(ast.Constant(None))
        case ast.Expr(value=ast.Call()) | ast.Assign() | ast.Raise() | ast.Break() | ast.Continue():
            yield "statement", ast.Pass()
        case ast.Call(args=[first, second, *rest]) if not isinstance(first, ast.Starred | ast.Constant):
            same = ast.dump(first) == ast.dump(second) or (not rest and ast.unparse(changed.func) in SYMMETRIC)
            if not isinstance(second, ast.Starred) and not same:
                changed.args = [second, first, *rest]
                yield "arguments", changed
        case _:
            pass


def _is_none(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) and value.value is None
