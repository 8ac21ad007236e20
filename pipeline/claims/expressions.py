"""Evaluate the expressions of claims: arithmetic over names of results, in Python's grammar, but never run as Python.

A result is named `condition.model`, `condition.model.metric` or `condition.model[variant].metric`, as in
`double.lomp.touches_found` or `task_1.lstm_direct[samples_100]`. Beside it stand numbers, + - * /, > and < (1 where
true, else 0), and min, max, abs and mean. A result is one number per seed, so that every step is paired by seed; of
several results min and max return the one whose mean is the lowest or the highest, not a mixture of them.
"""

import ast
import operator
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
import pandas as pd

from tactile.base.errors import InputError

Value: TypeAlias = pd.Series | float


class Result(NamedTuple):
    """The name of a result; metric: "" for the claim's own."""

    condition: str
    model: str
    variant: str
    metric: str


ARITHMETIC = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
COMPARISONS = {ast.Gt: operator.gt, ast.Lt: operator.lt}
FUNCTIONS = {
    "min": lambda *values: min(values, key=np.mean),
    "max": lambda *values: max(values, key=np.mean),
    "mean": lambda *values: sum(values) / len(values),
    "abs": abs,
}


def evaluate(expression: str, look_up: Callable[[Result], Value]) -> Value:
    """Return the value of an expression; look_up: gives that of each result. Raises InputError for other syntax."""
    try:
        return _value(ast.parse(expression.strip(), mode="eval").body, look_up)
    except (SyntaxError, TypeError, ValueError) as error:
        raise InputError(f"expression '{expression}': {error}") from error


def _value(node: ast.expr, look_up: Callable[[Result], Value]) -> Value:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.UnaryOp(op=ast.USub()):
            return -_value(node.operand, look_up)
        case ast.BinOp() if type(node.op) in ARITHMETIC:
            return ARITHMETIC[type(node.op)](_value(node.left, look_up), _value(node.right, look_up))
        case ast.Compare(ops=[op], comparators=[right]) if type(op) in COMPARISONS:
            gap = _value(node.left, look_up) - _value(right, look_up)
            return COMPARISONS[type(op)](gap, 0) + 0 * gap  # NaN where a side is missing
        case ast.Call(func=ast.Name(id=name), keywords=[]) if name in FUNCTIONS and node.args:
            return FUNCTIONS[name](*(_value(argument, look_up) for argument in node.args))
        case ast.Attribute() | ast.Subscript():
            return look_up(_result(node))
    raise ValueError(f"'{ast.unparse(node)}' is neither a result, a number, + - * / < >, nor {', '.join(FUNCTIONS)}")


def _result(node: ast.expr) -> Result:
    """Return the result that a node names."""
    match node:
        case ast.Attribute(value=ast.Attribute() | ast.Subscript() as named, attr=metric) if not _result(named).metric:
            return _result(named)._replace(metric=metric)
        case ast.Attribute(value=ast.Name(id=condition), attr=model):
            return Result(condition, model, "", "")
        case ast.Subscript(value=ast.Attribute() as named, slice=ast.Name(id=variant)) if not _result(named).metric:
            return _result(named)._replace(variant=variant)
    raise ValueError(
        f"'{ast.unparse(node)}' names no result: write condition.model, or condition.model[variant].metric"
    )
