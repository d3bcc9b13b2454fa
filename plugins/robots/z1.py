"""Unitree's Z1, without its gripper.

The description is the maker's, from the package example-robot-data. Its gripper turns a jaw, which a parallel gripper
does not, and is removed. Two links have no collision shape there and get the hulls of the maker's meshes.
"""

from __future__ import annotations

import numpy as np

from core.geometry import Pose
from core.interfaces import Robot
from plugins.robots.descriptions import measured, mended

MESHES = {f"link{i}": f"z1_description/meshes/collision/z1_Link{i}.STL" for i in ("01", "05")}

SOURCES = (
    "acceleration: the maker's z1_ros, z1_moveit_config, joint_limits.yaml",
    "payload: the maker's manual, technical data",
    "motors' inertia: a guess, the xArm's by torque; the maker states none",
    "flange: no drawing was found; the face has a radius of 28 mm, and an adapter with the ring of ISO 9409-1-50 is "
    "assumed",
)


def z1() -> Robot:
    """The arm with six joints, a reach of 0.74 m and a payload of 3 kg."""
    hand = ("gripperStator", "gripperMover")
    return Robot(
        name="z1",
        title="Unitree Z1",
        urdf=mended("z1_description/urdf/z1.urdf", drop=("world", *hand), collisions=MESHES),
        arm_joints=tuple(f"joint{i}" for i in range(1, 7)),
        home=(0.0, 2.0082, -1.2909, 0.8535, 0.0, 0.0),
        acceleration_limits=(4.0,) * 6,
        motor_inertia=(0.06, 0.12, 0.06, 0.06, 0.06, 0.06),
        mount_link="link06",
        mount=Pose.xyz_rpy((0.051, 0.0, 0.0), (0.0, -np.pi / 2, 0.0)),
        near_mount=("link06",),
        payload_kg=3.0,
        measured=measured("z1"),
        sources=SOURCES,
    )
