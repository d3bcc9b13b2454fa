"""An arm of six joints without a gripper: another kind than the default one, from its description as it is."""

import numpy as np

from core.geometry import Pose
from core.interfaces import Robot
from plugins.robots.descriptions import description


def six_joints(base: Pose | None = None, **changes: object) -> Robot:
    """Make the arm. At home its mount is at (0.5, 0, 0.5), with the world's axes."""
    turned = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2))
    numbers: dict[str, object] = {
        "name": "six",
        "title": "Six Joints",
        "urdf": description("ur_description/urdf/ur5_robot.urdf"),
        "arm_joints": (
            *(f"shoulder_{way}_joint" for way in ("pan", "lift")),
            "elbow_joint",
            *(f"wrist_{i}_joint" for i in (1, 2, 3)),
        ),
        "home": (-0.2201, -1.5543, 1.3795, -1.396, -1.5708, -0.2201),
        "acceleration_limits": (5.0,) * 6,
        "motor_inertia": (0.1,) * 6,
        "mount_link": "wrist_3_link",
        "mount": Pose.xyz_rpy((0.0, 0.0823, 0.0), (np.pi / 2, 0.0, 0.0)) @ turned,
        "near_mount": ("wrist_3_link", "ee_link"),
        "payload_kg": 5.0,
        "base": base or Pose(),
    }
    return Robot(**{**numbers, **changes})  # type: ignore[arg-type]
