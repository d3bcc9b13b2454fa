"""Read a number that a model wrote as a sum or in degrees: ``0.5 + 0.12``, ``pi/2``, ``90 deg``."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable

_LONGEST = 100  # characters
_FIGURE = re.compile(r"-?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")

_SUM = re.compile(
    r"(?:[-+*/()\s]|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?|(?:math|np|numpy)\.|pi|radians|deg2rad)+"
)
_DEGREES = re.compile(r"(.*?[\d.)])\s*(?:deg|degrees|°)", re.DOTALL)
# One number or two: a space stands before the sign, and none behind it.
_UNEVEN = re.compile(r"[\d.)]\s+[-+][\d.(]")

_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_SIGNS: dict[type, Callable[[float], float]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}


def read_figure(text: str) -> float | None:
    """Return the number that a text means, degrees in radians; None: it is not just one number."""
    return None if _UNEVEN.search(text) else _read_sum(text.strip())


def is_uneven(text: str) -> bool:
    """Report whether a text such as ``0.5 -0.2`` may be one number or two."""
    return _UNEVEN.search(text) is not None and _read_sum(text) is not None


def figures_in(text: str) -> list[float]:
    """Return all numbers in a text, in their order."""
    return [float(figure) for figure in _FIGURE.findall(text)]


def _read_sum(text: str) -> float | None:
    """Return the value of a sum, with or without a unit; None: it is none."""
    if len(text) > _LONGEST:
        return None

    in_degrees = _DEGREES.fullmatch(text)
    if in_degrees is not None:
        text = in_degrees[1]

    if _SUM.fullmatch(text) is None:
        return None
    try:
        value = _compute(ast.parse(text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError):
        return None
    return value if in_degrees is None else math.radians(value)


def _compute(node: ast.expr) -> float:
    """Compute a sum of numbers.

    Raises:
        ValueError: something else stands in it.
    """
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value)
        case ast.UnaryOp(op=sign, operand=operand) if type(sign) in _SIGNS:
            return float(_SIGNS[type(sign)](_compute(operand)))
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _OPERATORS:
            return float(_OPERATORS[type(sign)](_compute(left), _compute(right)))
        case ast.Name(id="pi") | ast.Attribute(attr="pi"):
            return math.pi
        case ast.Call(func=function, args=[angle]) if _is_radians(function):
            return math.radians(_compute(angle))
    raise ValueError("not a sum of numbers")


def _is_radians(function: ast.expr) -> bool:
    """Report whether a function turns degrees into radians."""
    name = getattr(function, "attr", getattr(function, "id", ""))
    return name in ("radians", "deg2rad")
