"""Hold bodies by bonds in a world that is stepped, until the force on a bond is too much."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from core.geometry import Array
from core.scene import Bond


class Bonds(ABC):
    """The bonds of a world, and the forces on them in each step since it began.

    An engine's class measures the forces, and releases a bond. Call `end_step` after each step.

    Args:
        bonds: K of them.
    """

    def __init__(self, bonds: Sequence[Bond]) -> None:
        self._names = [bond.name for bond in bonds]
        self._limits = np.array([bond.breaks_n for bond in bonds])
        self._holds = np.ones(len(bonds), dtype=bool)
        self._forces: list[Array] = []  # (K,) in each step

    @abstractmethod
    def measure(self) -> Array:
        """Measure the force on each bond in the last step (K,), N; that of one that is released does not count."""

    @abstractmethod
    def release(self, number: int) -> None:
        """Let go what a bond holds."""

    @property
    def steps(self) -> int:
        """How many steps were taken."""
        return len(self._forces)

    def save(self) -> tuple[Array, list[Array]]:
        """Return which bonds hold, and the forces so far."""
        return self._holds.copy(), list(self._forces)

    def restore(self, saved: tuple[Array, list[Array]]) -> None:
        """Go on from how other bonds of the same scene were; the engine holds and releases them itself."""
        holds, forces = saved
        self._holds = holds.copy()
        self._forces = list(forces)

    def end_step(self) -> None:
        """Note the forces of the last step, and release the bonds that they break."""
        if not self._names:
            return

        forces = np.where(self._holds, self.measure(), 0.0)
        self._forces.append(forces)

        for number in np.flatnonzero(forces > self._limits).tolist():
            self._holds[number] = False
            self.release(number)

    def loads(self, steps: Sequence[int]) -> dict[str, Array]:
        """Find the largest force on each bond since the instant before (T,), N, by name.

        Args:
            steps: how many steps are done at each instant (T,), rising.
        """
        if not self._names:
            return {}

        found = np.zeros((len(steps), len(self._names)))
        done = 0
        for number, count in enumerate(steps):
            if count > done:
                found[number] = np.max(self._forces[done:count], axis=0)
            done = count

        return dict(zip(self._names, found.T, strict=True))
