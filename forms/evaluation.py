"""Values of UFL scalars: energies and their derivatives as functions of numbers."""

import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from ufl import classes
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.corealg.traversal import unique_post_traversal

from elastune.forms.kinematics import Scalar


def evaluate(expression: Scalar) -> float:
    """The value of a UFL expression of numbers, with its derivatives carried out."""
    return float(apply_derivatives(apply_algebra_lowering(ufl.as_ufl(expression)))(()))


_OPERATIONS: dict[type, Callable[..., Any]] = {
    classes.Sum: operator.add,
    classes.Product: operator.mul,
    classes.Division: operator.truediv,
    classes.Power: operator.pow,
    classes.MinValue: np.minimum,
    classes.MaxValue: np.maximum,
    classes.Ln: np.log,
    classes.Exp: np.exp,
    classes.Sqrt: np.sqrt,
    classes.Sin: np.sin,
    classes.Cos: np.cos,
    classes.Tan: np.tan,
    classes.Sinh: np.sinh,
    classes.Cosh: np.cosh,
    classes.Tanh: np.tanh,
    classes.Asin: np.arcsin,
    classes.Acos: np.arccos,
    classes.Atan: np.arctan,
    classes.Atan2: np.arctan2,
    classes.Abs: abs,
    classes.Conditional: np.where,
    classes.LT: operator.lt,
    classes.GT: operator.gt,
    classes.LE: operator.le,
    classes.GE: operator.ge,
    classes.EQ: operator.eq,
    classes.NE: operator.ne,
    classes.AndCondition: np.logical_and,
    classes.OrCondition: np.logical_or,
    classes.NotCondition: np.logical_not,
    classes.Variable: lambda value, label: value,
    classes.ListTensor: lambda *entries: entries,
}


def as_numpy(expressions: Sequence[Scalar], arguments: Sequence[Scalar]) -> Callable[..., tuple[Any, ...]]:
    """UFL scalars as one function of numbers or arrays, with their derivatives carried out.

    UFL's own evaluation walks a tree in which every use of a subexpression is another branch; here each is
    computed once, for all expressions together.

    Args:
        expressions: Scalars made of nothing but the arguments, numbers and the operations of an energy.
        arguments: The UFL variables that the function takes, in its order.

    Returns:
        A function of as many numbers, or arrays of one shape, that returns one value an expression.
    """
    memory: list[Any] = []
    slots: dict[Scalar, int] = {}
    program = []
    given = set(arguments)
    for node in unique_post_traversal(apply_derivatives(ufl.as_vector(expressions))):
        slots[node] = len(memory)
        # numpy's numbers: Python's own raise an error or turn complex where an energy is not defined.
        value: Any = np.zeros(node.ufl_shape)[()] if isinstance(node, classes.Zero) else None
        if isinstance(node, classes.RealValue):
            value = np.float64(node)
        elif type(node) in _OPERATIONS and node not in given:
            operands = [slots[operand] for operand in node.ufl_operands]
            program.append((len(memory), _OPERATIONS[type(node)], operands))
        elif value is None and node not in given and not isinstance(node, classes.Label):
            raise NotImplementedError(f"expected an operation of an energy, got {type(node).__name__}")
        memory.append(value)
    inputs = [slots.get(argument) for argument in arguments]

    def function(*values: Any) -> tuple[Any, ...]:
        held = memory.copy()
        for slot, value in zip(inputs, values, strict=True):
            if slot is not None:
                held[slot] = np.asarray(value, dtype=float)[()]
        with np.errstate(all="ignore"):
            for slot, operation, operands in program:
                held[slot] = operation(*[held[operand] for operand in operands])
        return tuple(held[-1])

    return function
