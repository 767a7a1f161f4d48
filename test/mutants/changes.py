# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Changes of one thing in a kernel: an operator, a comparison, a number, a function, a choice."""

import ast
import copy
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
#: The opposite: with < for <= hardly a number of a flight would come out another one.
COMPARISONS = {
    **{ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt},
    **{ast.Eq: ast.NotEq, ast.NotEq: ast.Eq},
}
FUNCTIONS = {'min': 'max', 'max': 'min', 'sin': 'cos', 'cos': 'sin', 'abs': 'float'}
CHOICES = {ast.And: ast.Or, ast.Or: ast.And}
#: A number is made larger by this (-); of a whole one it is 1 more.
FACTOR = 1.5


class Change(NamedTuple):
    """A change; its number is that among all changes of the file."""

    module: str
    path: str
    number: int
    line: int
    before: str
    after: str


def changes(module: str, path: Path) -> list[Change]:
    """All changes of the kernels in a file, and of the numbers that stand above them."""
    tree, found = ast.parse(path.read_text(encoding='utf-8')), []
    for number, (node, changed) in enumerate(_all(tree)):
        before, after = ast.unparse(node), ast.unparse(changed)
        found.append(Change(module, str(path), number, node.lineno, before, after))
    return found


def mutated(change: Change) -> ast.Module:
    """The module with one thing changed."""
    tree = ast.parse(Path(change.path).read_text(encoding='utf-8'))
    node, changed = next(pair for n, pair in enumerate(_all(tree)) if n == change.number)
    made = _Replace(node, changed).visit(tree)
    return ast.fix_missing_locations(made)


class _Replace(ast.NodeTransformer):
    def __init__(self, node: ast.AST, changed: ast.AST) -> None:
        self._node, self._changed = node, changed

    def visit(self, node: ast.AST) -> ast.AST:
        return self._changed if node is self._node else self.generic_visit(node)


def _all(tree: ast.Module) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Expressions that can be changed, in order, each with what is to stand there instead."""
    for part in tree.body:
        is_kernel = isinstance(part, ast.FunctionDef) and any(
            isinstance(one, ast.Name) and one.id == 'kernel' for one in part.decorator_list
        )
        is_number = isinstance(part, ast.Assign) and isinstance(
            part.value, ast.Constant | ast.Tuple
        )
        for body in part.body if is_kernel else [part.value] if is_number else []:
            for node in ast.walk(body):
                changed = _changed(node)
                if changed is not None:
                    yield node, ast.copy_location(changed, node)


def _changed(node: ast.AST) -> ast.expr | None:
    """What stands for an expression after the change; None if it is not one that is changed."""
    made = copy.deepcopy(node)
    if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
        made.op = OPERATORS[type(node.op)]()
    elif isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        made.ops[0] = COMPARISONS[type(node.ops[0])]()
    elif isinstance(node, ast.BoolOp):
        made.op = CHOICES[type(node.op)]()
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        made = made.operand
    elif isinstance(node, ast.IfExp):
        made.body, made.orelse = made.orelse, made.body
    elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in FUNCTIONS:
        made.id = FUNCTIONS[node.id]
    elif isinstance(node, ast.Attribute) and node.attr in FUNCTIONS:
        made.attr = FUNCTIONS[node.attr]
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        value = node.value
        made.value = value + 1 if isinstance(value, int) else FACTOR * value if value else 1.0
    else:
        return None
    return made
