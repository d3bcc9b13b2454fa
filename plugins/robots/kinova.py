"""Kinova's JACO of the second generation (j2s6s200: six joints, spherical wrist), without its hand.

The description is the maker's, from the package example-robot-data. Its last link is a hand with two fixed fingers:
they are replaced by a disc of aluminium, 10 mm thick, that bears the tool. Joints that turn without end get
limits.
"""

from __future__ import annotations

import math

import numpy as np

from core.geometry import Cylinder, Pose
from core.interfaces import Robot
from core.values.descriptions import Inertial, Origin, RobotShape
from plugins.robots.descriptions import measured, mended

PREFIX = "j2s6s200_"
HAND = f"{PREFIX}link_6"
FINGERS = tuple(f"{PREFIX}link_finger_{part}{i}" for part in ("", "tip_") for i in (1, 2))
MESHES = ("base", "shoulder", "arm", "forearm", "wrist_spherical_1", "wrist_spherical_2")
LINKS = (f"{PREFIX}link_base", *(f"{PREFIX}link_{i}" for i in range(1, 6)))
DISC = Cylinder(radius=0.034, length=0.01)  # as wide as the ring that it closes
DISC_KG = 2700 * math.pi * DISC.radius**2 * DISC.length  # aluminium
ACROSS = DISC_KG * (3 * DISC.radius**2 + DISC.length**2) / 12
ENDLESS = {"lower": -2 * math.pi, "upper": 2 * math.pi}

SOURCES = (
    "limits of speed and torque: the maker's kinova-ros",
    "acceleration: a guess, full speed in a quarter of a second; the maker states none",
    "motors' inertia: dm_control's model of the arm",
    "payload: the maker's data sheet, at full reach",
    "flange: no drawing was found; an adapter with the ring of ISO 9409-1-50 is assumed, with a disc of 10 mm",
)


def kinova() -> Robot:
    """The arm with six slow joints, a reach of 0.9 m and a payload of 2.2 kg."""
    hulls = {link: f"kinova_description/meshes/{mesh}.dae" for link, mesh in zip(LINKS, MESHES, strict=True)}
    disc = Inertial(DISC_KG, (0.0, 0.0, -DISC.length / 2), (ACROSS, 0, 0, ACROSS, 0, DISC_KG * DISC.radius**2 / 2))
    return Robot(
        name="kinova",
        title="Kinova JACO 2",
        urdf=mended(
            "kinova_description/robots/kinova.urdf",
            drop=("base", f"{PREFIX}end_effector", *FINGERS),
            inertials={HAND: disc},
            limits={f"{PREFIX}joint_{i}": ENDLESS for i in (1, 4, 6)},
            collisions=hulls | {HAND: RobotShape(DISC, Origin((0.0, 0.0, -DISC.length / 2)))},
            undrawn=("hand_2finger.dae",),
        ),
        arm_joints=tuple(f"{PREFIX}joint_{i}" for i in range(1, 7)),
        home=(-0.02, 2.66, 4.312, 0.0, 1.652, -0.02),
        acceleration_limits=(2.5, 2.5, 2.5, 3.3, 3.3, 3.3),
        motor_inertia=(4.0, 4.0, 4.0, 2.0, 2.0, 2.0),
        mount_link=HAND,
        mount=Pose(np.array([0.0, 0.0, -DISC.length])),
        near_mount=(HAND, f"{PREFIX}link_5"),
        payload_kg=2.2,
        measured=measured("kinova"),
        sources=SOURCES,
    )
