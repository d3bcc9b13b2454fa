"""UFACTORY's xArm 7, without a gripper.

The description is the maker's, from the package example-robot-data. It collides with the meshes that are drawn; their
convex hulls are written to files, each with fewer corners.
"""

from __future__ import annotations

import numpy as np

from core.geometry import Pose
from core.interfaces import Robot
from plugins.robots.descriptions import measured, mended

LINKS = ("link_base", *(f"link{i}" for i in range(1, 8)))
MESHES = {link: f"xarm_description/meshes/xarm7/visual/{link}.stl" for link in LINKS}

SOURCES = (
    "acceleration: xArm-Python-SDK, which takes at most 20 rad/s^2",
    "motors' inertia: MuJoCo Menagerie's xArm 7",
    "payload and flange: the maker's user manual, technical specifications",
)


def xarm7() -> Robot:
    """The arm with seven joints and a payload of 3.5 kg."""
    return Robot(
        name="xarm7",
        title="UFACTORY xArm 7",
        urdf=mended("xarm_description/urdf/xarm7.urdf", drop=("world", "link_eef"), collisions=MESHES),
        arm_joints=tuple(f"joint{i}" for i in range(1, 8)),
        home=(0.0, 0.079, 0.0, 1.547, 0.0, 1.468, 0.0),
        acceleration_limits=(20.0,) * 7,
        motor_inertia=(0.1,) * 7,
        mount_link="link7",
        mount=Pose.xyz_rpy((0.0, 0.0, 0.0), (np.pi, 0.0, 0.0)),
        near_mount=("link7",),
        payload_kg=3.5,
        measured=measured("xarm7"),
        sources=SOURCES,
    )
