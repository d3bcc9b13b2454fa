"""What is possible in a robot or a scene, and yet hardly meant: units that were mixed up."""

from __future__ import annotations

from collections.abc import Iterator

_DEGREES = "degrees? A URDF has radians; MJCF has degrees, unless it says otherwise"
# The least and the most that is usual, how a value is said, and what it may be instead.
USUAL = {
    "body mass": (1e-5, 50.0, "weighs {:g} kg", "grams?"),
    "link mass": (1e-5, 1e3, "weighs {:g} kg", "grams?"),
    "length": (1e-4, 2.0, "is {:.3g} m long", "millimetres?"),
    "offset": (0.0, 5.0, "is {:.3g} m from the one before", "millimetres?"),
    "range": (0.1, 25.2, "ranges over {:.3g} rad", _DEGREES),
    "speed": (1e-3, 50.0, "turns at up to {:.3g} rad/s", _DEGREES),
}


def find_doubt(what: str, quantity: str, value: float) -> Iterator[str]:
    """Yield a line if a value of a quantity of `USUAL` is hardly meant; ``what`` has it."""
    least, most, words, question = USUAL[quantity]
    if not least <= abs(value) <= most:
        yield f"{what} {words.format(value)}; {question}"
