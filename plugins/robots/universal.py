"""The UR5 and the UR10 of Universal Robots, of the third generation (CB3), without a gripper.

The descriptions are ROS-Industrial's, from the package example-robot-data. Their inertias are replaced: the UR5's
wrist has 0.11 kg m^2 for 1.2 kg there, and both have links whose mass lies in their joints. The new ones are those of
Universal Robots' own description, moved into the frames of these links.
"""

from __future__ import annotations

import math

import numpy as np

from core.geometry import Pose
from core.interfaces import Robot
from core.values.descriptions import Inertial
from plugins.robots.descriptions import measured, mended
from plugins.robots.programs import program

JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
HALF_TURN_S = math.pi  # rad/s: 180 degrees a second

_MAKER = "Universal_Robots_ROS2_Description, config/{}, joint_limits.yaml and physical_parameters.yaml"
SOURCES = (
    "acceleration: Universal_Robots_ROS2_Driver, ur_moveit_config, joint_limits.yaml; the arms are limited by torque "
    "alone, and this is the maker's careful choice for planning",
    "flange and payload: the maker's data sheets",
)

UR5_INERTIALS = {
    "shoulder_link": Inertial(3.7, (0.0, 0.00193, -0.02561), (0.0149724, 0.0, 0.0, 0.0149724, 0.0, 0.0104063)),
    "upper_arm_link": Inertial(8.393, (0.0, -0.02249, 0.2125), (0.133886, 0.0, 0.0, 0.133886, 0.0, 0.0151074)),
    "forearm_link": Inertial(2.33, (0.0, 0.01035, 0.24225), (0.0312168, 0.0, 0.0, 0.0312168, 0.0, 0.004095)),
    "wrist_1_link": Inertial(1.219, (0.0, 0.0912, 0.01634), (0.00201389, 0.0, 0.0, 0.0021942, 0.0, 0.00201389)),
    "wrist_2_link": Inertial(1.219, (0.0, 0.01634, 0.09285), (0.00183104, 0.0, 0.0, 0.00183104, 0.0, 0.0021942)),
    "wrist_3_link": Inertial(0.1879, (0.0, 0.081141, 0.0), (8.06248e-05, 0.0, 0.0, 0.000132117, 0.0, 8.06248e-05)),
}
UR10_INERTIALS = {
    "shoulder_link": Inertial(7.1, (-0.021, 0.027, 0.0), (0.03408, 0.00425, -2e-05, 0.02156, 8e-05, 0.03529)),
    "upper_arm_link": Inertial(12.7, (0.0, -0.062941, 0.232), (0.77068, -2e-05, 5e-05, 0.76943, 0.01561, 0.02814)),
    "forearm_link": Inertial(4.27, (0.0, 0.018959, 0.3323), (0.30928, 0.0, 8e-05, 0.30646, -0.00916, 0.01014)),
    "wrist_1_link": Inertial(2.0, (0.0, 0.1219, 0.018), (0.00296, -1e-05, 0.0, 0.00222, -0.00024, 0.00258)),
    "wrist_2_link": Inertial(2.0, (0.0, 0.018, 0.1087), (0.00296, 0.0, 1e-05, 0.00258, 0.00024, 0.00222)),
    "wrist_3_link": Inertial(0.365, (0.0, 0.0662, 0.0), (0.0004, 0.0, 0.0, 0.00034, 0.0, 0.00041)),
}


def _arm(
    name: str,
    inertials: dict[str, Inertial],
    limits: dict[str, dict[str, float]],
    home: tuple[float, ...],
    motor_inertia: tuple[float, ...],
    flange: float,
    payload_kg: float,
    sources: tuple[str, ...],
) -> Robot:
    urdf = mended(
        f"ur_description/urdf/{name}_robot.urdf",
        drop=("world", "base", "ee_link", "tool0"),
        inertials=inertials,
        limits=limits,
    )
    return Robot(
        name=name,
        title=f"Universal Robots {name.upper()}",
        urdf=urdf,
        arm_joints=JOINTS,
        home=home,
        acceleration_limits=(5.0,) * 6,
        motor_inertia=motor_inertia,
        mount_link="wrist_3_link",
        mount=Pose.xyz_rpy((0.0, flange, 0.0), (np.pi / 2, 0.0, 0.0))
        @ Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, np.pi / 2)),
        near_mount=("wrist_3_link",),
        payload_kg=payload_kg,
        measured=measured(name),
        sources=(f"limits and inertias: {_MAKER.format(name)}", *SOURCES, *sources),
        programs=(program("run.script"),),
    )


def ur5() -> Robot:
    """The arm with six joints and a payload of 5 kg."""
    return _arm(
        "ur5",
        UR5_INERTIALS,
        {joint: {"velocity": HALF_TURN_S} for joint in JOINTS},
        home=(-0.2201, -1.5543, 1.3795, -1.396, -1.5708, -0.2201),
        motor_inertia=(0.1,) * 6,
        flange=0.0823,
        payload_kg=5.0,
        sources=("motors' inertia: MuJoCo Menagerie's UR5e, whose joints have the same sizes",),
    )


def ur10() -> Robot:
    """The arm with six joints, a reach of 1.3 m and a payload of 10 kg."""
    slow, fast = {"velocity": math.radians(120), "effort": 330.0}, {"velocity": HALF_TURN_S, "effort": 56.0}
    return _arm(
        "ur10",
        UR10_INERTIALS,
        dict(zip(JOINTS, (slow, slow, {"velocity": HALF_TURN_S, "effort": 150.0}, fast, fast, fast), strict=True)),
        home=(-0.3341, -1.9117, 2.1084, -1.7676, -1.5708, -0.3341),
        motor_inertia=(0.1,) * 6,
        flange=0.0922,
        payload_kg=10.0,
        sources=("motors' inertia: MuJoCo Menagerie's UR10e, whose joints have the same sizes",),
    )
