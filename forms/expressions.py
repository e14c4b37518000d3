"""Expressions of places, x, y and z, that are read from text without being run as a program."""

import ast
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_CONSTANTS = {"pi": math.pi, "e": math.e}
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
# By name: numpy's function and the name of UFL's.
_FUNCTIONS: dict[str, tuple[Callable[..., Any], str]] = {
    **{name: (getattr(np, name), name) for name in ("sin", "cos", "tan", "exp", "sqrt", "sinh", "cosh", "tanh")},
    "asin": (np.arcsin, "asin"),
    "acos": (np.arccos, "acos"),
    "atan": (np.arctan, "atan"),
    "atan2": (np.arctan2, "atan2"),
    "log": (np.log, "ln"),
    "abs": (np.abs, "abs"),
    "min": (np.minimum, "min_value"),
    "max": (np.maximum, "max_value"),
}
_TWO = ("atan2", "min", "max")
LONGEST = 1000


class ExpressionError(ValueError):
    """A text that is no expression: one line with what was expected and what came."""


@dataclass(frozen=True)
class Expression:
    """A function of the place at rest.

    Attributes:
        text: Of numbers, x, y, z, pi, e, + - * / ^ and functions such as sin, sqrt, min.

    Raises:
        ExpressionError: If the text is anything else.
    """

    text: str

    def __post_init__(self) -> None:
        _arithmetic(self._tree, self.text)
        try:
            self.at(np.full((1, 3), 0.5))
        except ArithmeticError as error:
            raise ExpressionError(f"{self.text!r}: {error}") from None

    @cached_property
    def _tree(self) -> ast.expr:
        if len(self.text) > LONGEST:
            raise ExpressionError(f"expected at most {LONGEST} characters, got {len(self.text)}")
        try:
            return ast.parse(self.text.strip().replace("^", "**"), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ExpressionError(f"{self.text!r} is no expression of x, y and z") from None

    @property
    def names(self) -> set[str]:
        """Coordinates that it depends on."""
        return {node.id for node in ast.walk(self._tree) if isinstance(node, ast.Name) and node.id in ("x", "y", "z")}

    def at(self, points: Array) -> Array:
        """Values at points of shape (n, 3), shape (n,)."""
        with np.errstate(all="ignore"):
            found = _value(self._tree, dict(zip("xyz", points.T, strict=True)), lambda name: _FUNCTIONS[name][0])
        return np.broadcast_to(np.asarray(found, dtype=np.float64), len(points)).copy()

    def ufl(self, X: Any) -> Any:
        """As a UFL expression of a coordinate of 2 or 3 components; in the plane z is zero."""
        import ufl

        names = {name: X[i] if i < len(X) else 0.0 for i, name in enumerate("xyz")}
        found = _value(self._tree, names, lambda name: abs if name == "abs" else getattr(ufl, _FUNCTIONS[name][1]))
        return found if isinstance(found, ufl.core.expr.Expr) else ufl.as_ufl(float(found))


def check(text: str) -> str:
    """The text, if it is an expression.

    Raises:
        ExpressionError: If it is not.
    """
    return Expression(text).text


Entry = float | Expression


def values(entry: Entry, points: Array) -> Array:
    """Of a number or an expression at points of shape (n, 3)."""
    return entry.at(points) if isinstance(entry, Expression) else np.full(len(points), float(entry))


def symbolic(entry: Entry, X: Any) -> Any:
    """A number as it is, an expression as one of UFL's."""
    return entry.ufl(X) if isinstance(entry, Expression) else entry


def _arithmetic(node: ast.AST, text: str) -> None:
    """Refuses whatever is not arithmetic.

    Raises:
        ExpressionError: If it is not.
    """
    if isinstance(node, ast.Constant) and type(node.value) in (int, float) and math.isfinite(node.value):
        return
    if isinstance(node, ast.Name):
        if node.id not in ("x", "y", "z", *_CONSTANTS):
            raise ExpressionError(f"{text!r}: unknown name {node.id!r}; expected x, y, z, pi or e")
        return
    if isinstance(node, ast.BinOp | ast.UnaryOp) and type(node.op) in _OPERATORS:
        children = [node.left, node.right] if isinstance(node, ast.BinOp) else [node.operand]
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        name, count = node.func.id, 2 if node.func.id in _TWO else 1
        if name not in _FUNCTIONS:
            raise ExpressionError(f"{text!r}: unknown function {name!r}; expected one of {', '.join(_FUNCTIONS)}")
        if len(node.args) != count:
            raise ExpressionError(f"{text!r}: {name} takes {count} argument{'s' * (count > 1)}, got {len(node.args)}")
        children = list(node.args)
    else:
        raise ExpressionError(f"{text!r} is no expression of x, y and z")
    for child in children:
        _arithmetic(child, text)


def _value(node: ast.AST, names: dict[str, Any], function: Callable[[str], Callable[..., Any]]) -> Any:
    """A checked tree's value.

    Args:
        node: Its root.
        names: Values of x, y and z.
        function: By name.
    """
    if isinstance(node, ast.Constant):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return _CONSTANTS[node.id] if node.id in _CONSTANTS else names[node.id]
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_value(node.left, names, function), _value(node.right, names, function))
    if isinstance(node, ast.UnaryOp):
        return _OPERATORS[type(node.op)](_value(node.operand, names, function))
    assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    return function(node.func.id)(*(_value(argument, names, function) for argument in node.args))
