"""Stop what rolls: rolling friction, which PhysX lacks."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from core.geometry import Vector

# How fast rolling is stopped, up to the brake's torque, 1/s: at once.
_BRAKE = 1e4
# Slower than so many m/s a body rests.
_RESTS = 0.05
_ALIKE = (0.98, 1.02)  # a brake is updated if the force changed by more than these


class Brake(NamedTuple):
    """A drive that stops the rotation of a free body.

    Attributes:
        number: the body's.
        drive: SAPIEN's.
        impulse: the drive's, per step and m/s^2.
        held: how many times as much it is where the body rests.
    """

    number: int
    drive: Any
    impulse: float
    held: float

    def limit(self, acceleration: float) -> None:
        """Limit the torque, for a normal force of the body's mass times ``acceleration``."""
        most = self.impulse * acceleration
        self.drive.set_drive_property_slerp(
            0.0,
            _BRAKE,
            most,
            "acceleration",
        )


class Brakes:
    """The brakes of a world, at first as for bodies that rest.

    A brake's torque is at most the arm of rolling friction times the normal force, which is taken to be what makes the
    body deviate from free fall.

    Args:
        brakes: of all bodies that have one.
        seconds: between two adjustments.
        gravity: m/s^2, along the world's axes.
    """

    def __init__(self, brakes: list[Brake], seconds: float, gravity: Vector) -> None:
        weight = float(np.linalg.norm(gravity))
        self._up: npt.NDArray[np.float32] = np.negative(gravity, dtype=np.float32)
        self._brakes = brakes
        self._seconds = seconds
        self._numbers = np.array([brake.number for brake in brakes], dtype=np.intp)
        squares = [brake.held * brake.held for brake in brakes]
        self._held = np.array(squares, dtype=np.float32)
        still = np.zeros((len(brakes), 3), dtype=np.float32)
        self._velocities: npt.NDArray[np.float32] = still

        # Squares of the accelerations between which a brake may stay as it is.
        self._low = (_ALIKE[0] * weight) ** 2 * self._held
        self._high = (_ALIKE[1] * weight) ** 2 * self._held
        for brake in brakes:
            brake.limit(brake.held * weight)

    def adjust(self, velocities: npt.NDArray[np.float32]) -> None:
        """Update the brakes from the velocities (B, 3) of all free bodies."""
        braked = velocities.take(self._numbers, axis=0)
        contact = (braked - self._velocities) / self._seconds + self._up
        self._velocities = braked
        squares = np.einsum("bi,bi->b", contact, contact)
        resting = np.einsum("bi,bi->b", braked, braked) < _RESTS**2
        squares *= np.where(resting, self._held, 1)

        changed = ((squares < self._low) | (squares > self._high)).nonzero()[0]
        if not len(changed):
            return

        accelerations = np.sqrt(squares[changed])
        for number, acceleration in zip(
            changed.tolist(), accelerations.tolist(), strict=True
        ):
            self._brakes[number].limit(acceleration)

        self._low[changed] = (_ALIKE[0] * accelerations) ** 2
        self._high[changed] = (_ALIKE[1] * accelerations) ** 2
