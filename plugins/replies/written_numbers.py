"""Read a number that a model wrote as a sum or with a unit: ``0.5 + 0.12``, ``pi/2``, ``90 deg``, ``45 mm``."""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Mapping

from plugins.replies.assumptions import assume

LENGTHS = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
"""How many of each unit are a metre."""

ANGLES = {"rad": 1.0, "deg": math.degrees(1.0)}
"""How many of each unit are a radian."""

TIMES = {"s": 1.0, "ms": 1000.0}
"""How many of each unit are a second."""

SPEEDS = {"m/s": 1.0, "cm/s": 100.0, "mm/s": 1000.0}
"""How many of each unit are a metre in a second."""

MASSES = {"kg": 1.0, "g": 1000.0}
"""How many of each unit are a kilogram."""

FORCES = {"n": 1.0}
"""How many of each unit are a newton."""

_UNITS = {name: name for name in (*LENGTHS, *ANGLES, *TIMES, *SPEEDS, *MASSES, *FORCES)}
# Units as they are spelled out.
_UNITS |= {
    **dict.fromkeys(("metre", "metres", "meter", "meters"), "m"),
    **dict.fromkeys(("centimetre", "centimetres", "centimeter", "centimeters"), "cm"),
    **dict.fromkeys(("millimetre", "millimetres", "millimeter", "millimeters"), "mm"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("°", "degree", "degrees"), "deg"),
    **dict.fromkeys(("sec", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("mps", "meters/second", "metres/second"), "m/s"),
    **dict.fromkeys(("gram", "grams"), "g"),
    **dict.fromkeys(("kilogram", "kilograms"), "kg"),
    **dict.fromkeys(("newton", "newtons"), "n"),
}

_LONGEST = 100  # characters
_FIGURE = re.compile(r"-?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_NUMBER = r"(?:\d++\.?\d*+|\.\d++)(?:e[-+]?\d{1,3}+)?+"
_SUM = re.compile(
    rf"(?:[-+*/()\s]|{_NUMBER}(?!\w)|(?:math|np|numpy)\.|pi|radians|deg2rad|sqrt|float)++"
)
_UNIT = re.compile(r"(.*(?:[\d.)]|pi))\s*([a-z°]+(?:/[a-z]+)?)")
# Between two numbers: a unit behind them may be of both or of the last.
_SIGN = re.compile(r"[\d.)i]\s*[-+]\s*[\d.(p]")
# One number or two: a space stands before the sign, and none behind it.
_UNEVEN = re.compile(r"[\d.)]\s+[-+][\d.(]")

_OPERATORS: dict[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_FUNCTIONS: dict[str, Callable[[float], float]] = {
    "radians": math.radians,
    "deg2rad": math.radians,
    "sqrt": math.sqrt,
    "float": float,
}


def read_figure(text: str, units: Mapping[str, float]) -> float | None:
    """Return the number that a text means, in the base of its ``units``; None: it is not just one number."""
    if _UNEVEN.search(text):
        return None

    amount, unit = _split(text)
    if not unit:
        return _read_sum(amount)

    value = None if _SIGN.search(amount) else _read_sum(amount)
    if value is None or unit not in units:
        return None

    assume(f"numbers with {unit!r} are read in that unit")
    return value / units[unit]


def find_unit(word: str) -> str | None:
    """Return the unit that a word means, as the tables here name it; None: none."""
    return _UNITS.get(word.lower())


def has_unit(text: str) -> bool:
    """Report whether a text is a number with a unit."""
    return _split(text)[1] != ""


def _split(text: str) -> tuple[str, str]:
    """Split a text into an amount and its unit; without one the unit is empty."""
    text = text.strip().lower().replace("π", "pi")
    found = _UNIT.fullmatch(text)
    if found is None or found[2] not in _UNITS:
        return text, ""

    return found[1], _UNITS[found[2]]


def is_uneven(text: str) -> bool:
    """Report whether a text such as ``0.5 -0.2`` may be one number or two."""
    return _UNEVEN.search(text) is not None and _read_sum(text.strip()) is not None


def figures_in(text: str) -> list[float]:
    """Return all numbers in a text, in their order."""
    return [float(figure) for figure in _FIGURE.findall(text)]


def _read_sum(text: str) -> float | None:
    """Return the value of a sum; None: it is none."""
    if len(text) > _LONGEST or _SUM.fullmatch(text) is None:
        return None

    try:
        return _compute(ast.parse(text, mode="eval").body)
    except (SyntaxError, ValueError, ArithmeticError):
        return None


def _compute(node: ast.expr) -> float:
    """Compute a sum of numbers.

    Raises:
        ValueError: something else stands in it.
    """
    match node:
        case ast.Constant(value=int() | float() as value):
            return float(value)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_compute(operand)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _compute(operand)
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _OPERATORS:
            return _OPERATORS[type(sign)](_compute(left), _compute(right))
        case ast.Name(id="pi") | ast.Attribute(attr="pi"):
            return math.pi
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=[inner]):
            if name in _FUNCTIONS:
                return _FUNCTIONS[name](_compute(inner))
    raise ValueError("not a sum of numbers")
