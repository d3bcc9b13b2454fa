"""The Franka Panda, with its hand.

The description is franka_ros's, from the package example-robot-data. Any engine can read it without PyBullet, and its
masses and inertias are the identified ones (C. Gaz et al., "Dynamic identification of the
Franka Emika Panda robot with retrieval of feasible parameters using penalty-based optimization", IEEE RA-L 2019),
where pybullet_data's copy has placeholders.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT
from core.geometry import Pose
from core.interfaces import ISO_9409_1_50, Gripper, Robot
from plugins.robots.descriptions import description, measured
from plugins.robots.programs import program

SOURCES = (
    "acceleration: Franka Control Interface documentation, 'Robot and interface specifications'",
    "motors' inertia: Franka's figures for the FR3, in the README of Drake's franka_description",
)

# Measured on the description's mesh of panda_link7: its face is at 0.1068 m, 0.2 mm before panda_link8; threads are at
# +-45 and +-135 degrees about panda_link8, 9.5 mm deep, the pin at +90 degrees; the recess is 31.5 mm wide and 8 mm
# deep. The mount is turned on panda_link8.
FLANGE = replace(ISO_9409_1_50, bolt_angle=0.0, pin_angle=math.radians(-135))


def hand() -> Gripper:
    """The hand with two fingers."""
    return Gripper(
        link="panda_hand",
        mount=Pose.xyz_rpy((0.0, 0.0, 0.0), (np.pi, 0.0, 0.0)),
        near_mount=("panda_hand",),
        joints=("panda_finger_joint1", "panda_finger_joint2"),
        links=("panda_leftfinger", "panda_rightfinger"),
        travel_m=0.04,
        force_n=70.0,  # continuous: Franka hand's data sheet
        friction=1.0,  # rubber tips
    )


def panda() -> Robot:
    """The arm with seven joints and a payload of 3 kg."""
    gripper = hand()
    return Robot(
        name="panda",
        title="Franka Panda",
        urdf=description("panda_description/urdf/panda.urdf"),
        arm_joints=tuple(f"panda_joint{i}" for i in range(1, 8)),
        home=(-0.0018, -0.1860, 0.0017, -2.1008, 0.0003, 1.9147, 0.7847),
        acceleration_limits=(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
        motor_inertia=(0.605721456, 0.605721456, 0.462474144, 0.462474144, 0.205544064, 0.205544064, 0.205544064),
        mount_link="panda_link8",  # 0.107 m beyond panda_link7; the hand is turned by -45 degrees on it
        mount=Pose.xyz_rpy((0.0, 0.0, 0.0), (np.pi, 0.0, -np.pi / 4)),
        near_mount=("panda_link7", "panda_link8"),
        payload_kg=3.0,
        flange=FLANGE,
        gripper=gripper,
        aliases=(  # the paper's names
            ("panda_virtual", RIGID_MOUNT),
            *zip(gripper.links, GRIPPER_MOUNTS, strict=True),
        ),
        measured=measured("panda"),
        sources=SOURCES,
        programs=(program("run_franky.py"),),
    )
