"""What a design is made from, which is all that offspring vary: values of a way's parameters, and where its head is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from core.geometry import Pose

Values = Mapping[str, float]
"""The values of a way's parameters, by name."""

Shaft = Literal["gantry", "elbow", "slope", "bridge"]
"""A kind of shaft.

A gantry goes out from the mount and down to the head, an elbow down and out, a slope straight there. A bridge goes out,
up, on above what stands there, and down.
"""

SHAFTS: tuple[Shaft, ...] = get_args(Shaft)


@dataclass(frozen=True)
class Mount:
    """Where a head is in the frame of the tool mount, and which kind of shaft carries it there.

    Attributes:
        x: metres.
        y: metres.
        z: metres.
        yaw: radians.
        shaft: one of `SHAFTS`.
    """

    x: float
    y: float
    z: float
    yaw: float
    shaft: Shaft

    @property
    def pose(self) -> Pose:
        """The head's pose in the frame of the tool mount."""
        return Pose.xyz_rpy((self.x, self.y, self.z), (0.0, 0.0, self.yaw))


@dataclass(frozen=True)
class Recipe:
    """What a tool and a plan are made from.

    Attributes:
        values: of the parameters of its way.
        mount: where the head is; None: the head says it itself.
    """

    values: Values
    mount: Mount | None = None
