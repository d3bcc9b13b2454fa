"""Define the numbers of a tool or an action plan that a search may vary.

Plugins import it from `core.interfaces`. Covered by `tests/core/designs/test_varying.py`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
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
        steps: a small change of each, which a search begins with.
        lower: with ``upper`` their bounds.
        modes: (N, N), in steps; each column is a change of numbers that belong together. By default each number
            has a mode of its own.
    """

    values: Array = field(default_factory=_none)
    steps: Array = field(default_factory=_none)
    lower: Array = field(default_factory=_none)
    upper: Array = field(default_factory=_none)
    modes: Array = field(default_factory=_none)

    def __post_init__(self) -> None:
        if not self.modes.size:
            object.__setattr__(self, "modes", np.eye(len(self.values)))

    @classmethod
    def near(cls, values: Array, step: float, most: float) -> Numbers:
        """Numbers of one kind, with the same step, from -``most`` to ``most``."""
        same = np.ones(np.size(values))
        return cls(np.ravel(values).astype(np.float64), step * same, -most * same, most * same)

    @classmethod
    def along(cls, points: Array, step: float, most: float) -> Numbers:
        """Numbers of one kind, of points (K, C) in order.

        The modes are cosines along the order of the points. The first one shifts all points alike, and each later one
        is smaller. So a search begins with smooth changes, as STOMP does (M. Kalakrishnan et al., ICRA 2011).
        """
        count, each = points.shape
        order = np.arange(count)
        waves = np.cos(np.pi * np.outer(order + 0.5, order) / max(count, 1)) / (1.0 + order)
        return replace(cls.near(points, step, most), modes=np.kron(waves, np.eye(each)))

    def changed(self, amounts: Array) -> Array:
        """Return the values (N,) with ``amounts`` (N,) of each mode added, within the bounds."""
        return np.clip(self.values + self.steps * (self.modes @ amounts), self.lower, self.upper)

    def __add__(self, other: Numbers) -> Numbers:
        ours, theirs = ((n.values, n.steps, n.lower, n.upper) for n in (self, other))
        values, steps, lower, upper = (np.concatenate(pair) for pair in zip(ours, theirs, strict=True))
        corner = np.zeros((len(self), len(other)))
        return Numbers(values, steps, lower, upper, np.block([[self.modes, corner], [corner.T, other.modes]]))

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
        ours, theirs = self.parameters(design), self.parameters(other)
        return theirs.values if type(design) is type(other) and len(ours) == len(theirs) else None
