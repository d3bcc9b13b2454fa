"""Enlarge a small arm, so that it does in tasks as they are what it does itself in tasks that are as much smaller.

Where lengths are k times as large and nothing is denser, gravity keeps the movement alike (Froude's rule): times grow
by k^(1/2), speeds of joints by k^(-1/2), masses and forces by k^3, torques by k^4, moments of inertia by k^5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

from core.errors import UsageError
from core.geometry import Pose
from core.imports.documents import read_xml
from core.imports.urdf import read_tree
from core.interfaces import Robot
from core.robot.writing import write
from core.values.descriptions import MOMENTS

# How numbers in a URDF grow, as powers of k.
_POWERS = {
    "origin": {"xyz": 1},
    "box": {"size": 1},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "mesh": {"scale": 1},
    "mass": {"value": 3},
    "inertia": dict.fromkeys(MOMENTS, 5),
}
_TURNS = {"effort": 4, "velocity": -0.5}  # limits of joints
_SLIDES = {"lower": 1, "upper": 1, "effort": 3, "velocity": 0.5}
REACH_M = 0.8  # of the arm that tasks are for
_LEAST_M = 0.05


def find_factor(reach: float | None) -> float:
    """Return how many times larger an arm of a reach, metres, has to be for tasks; None: 1.

    Raises:
        UsageError: the reach is that of no arm, or of a larger one.
    """
    if reach is None:
        return 1.0
    if not _LEAST_M <= reach <= REACH_M:
        raise UsageError(
            f"robot.reach must be from {_LEAST_M:g} to {REACH_M:g} m, got {reach:g}; an arm that reaches farther needs "
            "none: leave it out"
        )

    return REACH_M / reach


def describe_factor(k: float) -> str:
    """Say what it means for an arm to be ``k`` times as large as it is."""
    percent = f"{100 / k:.3g} %"
    return (
        f"simulated {k:.3g} times as large: it does what the arm itself does in tasks of {percent} of the size. "
        "vlmgineer export writes the tool, the motion and the scene in the arm's own size"
    )


def enlarge(robot: Robot, k: float) -> Robot:
    """Enlarge a robot ``k`` times, which keeps it as its original; its flange stays."""
    root = read_xml(write(robot.description).encode(), Path("robot"))
    for element in root.iter():
        _enlarge_numbers(element, _POWERS.get(element.tag, {}), k)

    for joint in root.iter("joint"):
        powers = _SLIDES if joint.get("type") == "prismatic" else _TURNS
        for limit in joint.iter("limit"):
            _enlarge_numbers(limit, powers, k)

    gripper = robot.gripper
    if gripper is not None:
        gripper = replace(
            gripper,
            mount=_enlarge_pose(gripper.mount, k),
            travel_m=k * gripper.travel_m,
            force_n=k**3 * gripper.force_n,
        )

    return replace(
        robot,
        title=f"{robot.title}, {k:.3g} times as large",
        description=read_tree(root),
        home=_enlarge_joints(robot, robot.home, 1, 0, k),
        acceleration_limits=_enlarge_joints(robot, robot.acceleration_limits, 0, -1, k),
        motor_inertia=_enlarge_joints(robot, robot.motor_inertia, 3, 5, k),
        mount=_enlarge_pose(robot.mount, k),
        payload_kg=robot.payload_kg * k**3,
        gripper=gripper,
        enlarged=k,
        original=robot,
    )


def _enlarge_joints(
    robot: Robot, values: Sequence[float], slides: float, turns: float, k: float
) -> tuple[float, ...]:
    """Multiply values (J,) of the joints by powers of ``k``: those that slide and those that turn have one each."""
    powers = [slides if sliding else turns for sliding in robot.slides]
    return tuple(value * k**power for value, power in zip(values, powers, strict=True))


def _enlarge_pose(pose: Pose, k: float) -> Pose:
    return Pose.from_rotation(k * pose.position, pose.rotation)


def _enlarge_numbers(element: Element, powers: Mapping[str, float], k: float) -> None:
    """Multiply attributes by powers of ``k``."""
    if element.tag == "mesh":
        element.attrib.setdefault("scale", "1 1 1")

    for name in powers.keys() & element.attrib.keys():
        numbers = map(float, element.attrib[name].split())
        larger = [repr(number * k ** powers[name]) for number in numbers]
        element.set(name, " ".join(larger))
