"""The settings of ``robot=urdf``: what is chosen of a file, and what a description does not say of its arm."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict

from core.errors import UsageError, check_positive
from core.geometry import Cylinder
from core.hooks import Harmless, Names
from core.values.robots import ISO_9409_1_50, Flange

PAYLOAD_KG = 1.0  # a URDF has none


@dataclass(frozen=True)
class GripperOptions:
    """Say what a description does not say of its parallel gripper.

    Attributes:
        link: its first link. It goes, with all that it bears, where a rigid tool is mounted.
        joints: of its two fingers: prismatic, 0 when closed.
        force_n: of each finger; None: the smaller effort in the joints' limits.
        friction: of the fingers.
    """

    link: Harmless[str]
    joints: Harmless[tuple[str, str]]
    force_n: float | None = None
    friction: float = 1.0

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}


@dataclass(frozen=True)
class BoltOptions:
    """Say where a flange has its bolts, metres and radians; the defaults are those of ISO 9409-1-50-4-M6.

    Attributes:
        circle_m: diameter of the ring of bolts.
        count: how many, equally spaced.
        thread: such as M6.
        angle: of the first bolt, about the mount's z, from the axis of the flange's frame that is nearest to its x.
        disc_m: diameter of the flange.
        centring_m: diameter of the recess in the middle; None: there is none.

    Raises:
        UsageError: a number is not positive, or the ring does not lie on the disc.
    """

    circle_m: float = 0.05
    count: int = 4
    thread: Harmless[str] = "M6"
    angle: float = math.pi / 4
    disc_m: float = 0.063
    centring_m: float | None = 0.0315

    __pydantic_config__: ClassVar[ConfigDict] = {"extra": "forbid"}

    def flange(self) -> Flange:
        check_positive(
            "robot.bolts.", circle_m=self.circle_m, count=self.count, disc_m=self.disc_m
        )
        if not (self.centring_m or 0.0) < self.circle_m < self.disc_m < 1.0:
            raise UsageError(
                "robot.bolts: lengths are diameters in metres, centring_m < circle_m < disc_m"
            )
        disc = Cylinder(self.disc_m / 2, ISO_9409_1_50.disc.length)
        ring = (self.circle_m, self.count, self.thread)
        return Flange(disc, *ring, bolt_angle=self.angle, centring_m=self.centring_m)


@dataclass(frozen=True)
class ArmSettings:
    """What is chosen of a file, and what a description does not say of its arm.

    Attributes:
        path: a URDF or MJCF file.
        home: joints (J,) from the base on, radians, or metres where one slides; there the flange looks down.
            ``vlmgineer import`` finds some.
        flange: the link that bears tools; None: the only one that bears no other link.
        title: as people call it; empty: the name in the description.
        mount_rpy: how the mount is turned in the flange's frame, radians; None: by right angles, so that its axes at
            home are nearest to the world's.
        face_m: how far beyond the flange's frame its face is, where tools begin.
        payload_kg: what it carries at most.
        mass_kg: of the whole arm: what the file's masses lack is spread over the hulls of links that have none.
        collision: ``visual``: links without collision shapes collide as they are drawn; ``file``: they don't.
        velocity: limits, rad/s or m/s, of all joints or each (J,); None: the file's.
        effort: the same, N m or N.
        reach: how far the arm reaches, metres: for tasks, which are for 0.8 m, it is simulated as much larger, see
            `plugins.robots.enlarging`; None: as large as it is.
        acceleration: limits (J,), rad/s^2; None: each joint reaches its speed limit in half a second.
        motor_inertia: (J,), reflected through the gears, kg m^2, of a slide kg; None: the file's, or 0.1, less below
            28 N m, and 0 of a slide.
        gripper: the parallel gripper, if there is one.
        bolts: of the flange; None: those of ISO 9409-1-50-4-M6.
        fixed: joints that are held at 0, or each at its value, radians or metres.
        without: links that are left out, with all that they bear.
    """

    path: Annotated[Path, Names("file")]
    home: list[float] | None = None
    flange: Harmless[str | None] = None
    title: Harmless[str] = ""
    mount_rpy: tuple[float, float, float] | None = None
    face_m: float = 0.0
    payload_kg: float = PAYLOAD_KG
    mass_kg: float | None = None
    collision: Literal["file", "visual"] = "file"
    velocity: float | list[float] | None = None
    effort: float | list[float] | None = None
    reach: float | None = None
    acceleration: list[float] | None = None
    motor_inertia: list[float] | None = None
    gripper: GripperOptions | None = None
    bolts: BoltOptions | None = None
    fixed: Harmless[list[str] | dict[str, float] | None] = None
    without: Harmless[list[str] | None] = None
