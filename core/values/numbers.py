"""Define the numbers of a tool or an action plan that a search may vary.

Plugins import it from `core.interfaces`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from core.geometry import Array

D = TypeVar("D")


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, eq=False)
class Numbers:
    """N numbers, each array (N,); by default none.

    Attributes:
        values: what they are now.
        steps: a small change of each.
        lower: with ``upper`` their bounds.
        shapes: those (K, C) of the tables that they form, one after the other: K points in order, such as waypoints,
            with C coordinates each. By default each number has a table of its own.
    """

    values: Array = field(default_factory=_none)
    steps: Array = field(default_factory=_none)
    lower: Array = field(default_factory=_none)
    upper: Array = field(default_factory=_none)
    shapes: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        if not self.shapes:
            object.__setattr__(self, "shapes", ((1, 1),) * len(self.values))

    @classmethod
    def near(cls, points: Array, steps: float | Array, most: float | Array) -> Numbers:
        """Make a table of points (K, C), or of one (C,), with bounds from -``most`` to ``most``.

        ``steps`` and ``most`` are those of all coordinates, or of each (C,).
        """
        table = np.atleast_2d(points).astype(np.float64)
        full = np.ones(table.shape)
        return cls(
            table.ravel(),
            np.ravel(full * steps),
            np.ravel(full * -np.asarray(most)),
            np.ravel(full * most),
            (table.shape,),
        )

    def __add__(self, other: Numbers) -> Numbers:
        arrays = {}
        for name in ("values", "steps", "lower", "upper"):
            pair = (getattr(self, name), getattr(other, name))
            arrays[name] = np.concatenate(pair)
        return Numbers(**arrays, shapes=self.shapes + other.shapes)

    def __len__(self) -> int:
        return len(self.values)


class Variable(Generic[D]):
    """A representation whose designs have numbers that a search may vary without asking a model; by default none."""

    def parameters(self, design: D) -> Numbers:
        """Return the N numbers of a design that may vary."""
        return Numbers()

    def with_parameters(self, design: D, values: Array) -> D:
        """Return the design with ``values`` (N,) of its `parameters`; it is read and checked as a model's afterwards.

        Raises:
            DesignError: there is no such design.
        """
        return design

    def toward(self, design: D, other: D) -> Array | None:
        """Return the values (N,) of the design's `parameters` that make it like ``other``.

        None: the two differ in more than numbers. By default these are the values of ``other``.
        """
        theirs = self.parameters(other)
        if type(design) is type(other) and len(self.parameters(design)) == len(theirs):
            return theirs.values
        return None
