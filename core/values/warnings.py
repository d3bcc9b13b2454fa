"""What is possible in a robot or a scene, and yet hardly meant: units that were mixed up."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from functools import cache
from multiprocessing import parent_process

_log = logging.getLogger(__name__)

_DEGREES = "degrees? A URDF has radians; MJCF has degrees, unless it says otherwise"
# The least and the most that is usual, how a value is said, and what it may be instead.
USUAL = {
    "body mass": (1e-5, 50.0, "weighs {:g} kg", "grams?"),
    "link mass": (1e-5, 1e3, "weighs {:g} kg", "grams?"),
    "length": (1e-4, 2.0, "is {:.3g} m long", "millimetres?"),
    "density": (1.0, 2.3e4, "has {:.3g} kg/m^3", "kilograms and metres are read"),
    "gyration": (
        1e-4,
        2.0,
        "turns as if its mass were {:.3g} m from its middle",
        "inertias are read in kg m^2",
    ),
    "offset": (0.0, 5.0, "is {:.3g} m from the one before", "millimetres?"),
    "turn": (0.0, 6.3, "is turned by {:.3g} rad", _DEGREES),
    "range": (0.13, 25.2, "ranges over {:.3g} rad", _DEGREES),
    "effort": (1e-3, 2e4, "bears up to {:.3g} N m", "newton millimetres?"),
    "speed": (1e-3, 50.0, "turns at up to {:.3g} rad/s", _DEGREES),
}


def find_warning(what: str, quantity: str, value: float) -> Iterator[str]:
    """Yield a line if a value of a quantity of `USUAL` is hardly meant; ``what`` has it."""
    least, most, words, question = USUAL[quantity]
    if not least <= abs(value) <= most:
        yield f"{what} {words.format(value)}; {question}"


@cache
def warn_once(text: str) -> None:
    """Report a warning, once; workers stay silent, since the main process reports it."""
    if parent_process() is None:
        _log.warning(text)
