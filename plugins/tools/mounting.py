"""Describe the mounts that tools hang from, for the instructions of every tool representation."""

from __future__ import annotations

import numpy as np

from core.design import RIGID_MOUNT
from core.geometry import Array
from core.interfaces import Brief, Robot, Task
from core.robot.extents import Finger, fingers_of
from core.support.text import short_number

_MEET_M = 0.0005  # fingers nearer than this meet


def describe_mount(brief: Brief) -> str:
    """Write which links the tool hangs from, where their axes point, and what must be touched."""
    return _gripper_mount(brief.task.robot) if brief.gripper else _rigid_mount(brief.task)


def first_box(brief: Brief) -> tuple[str, str, Array, Array]:
    """Make an example: mount, name, size (3,) and place (3,) of a shaft at the flange, or of a pad on the left finger.

    The pad is on the inside of the finger's tip. Neither is turned in its mount's frame.
    """
    robot = brief.task.robot
    if not brief.gripper:
        size = np.array([0.02, 0.02, 0.1])
        return RIGID_MOUNT, "shaft", size, np.array([0.0, 0.0, -(robot.flange.disc.length + size[2]) / 2])
    finger = fingers_of(robot)[0]
    out, down = np.abs(finger.opens), np.abs(finger.tip)
    size = 0.02 * (1 - out - down) + 0.015 * out + 0.04 * down
    at = np.mean(finger.extent, axis=0) * (1 - out - down)
    at += out * finger.face(-finger.opens) + 0.0075 * finger.opens + down * finger.face(finger.tip)
    return finger.name, "left_pad", size, at + 0.0155 * finger.tip  # it overlaps the finger by 4.5 mm


_RIGID_MOUNT = """\
The tool is rigid{place}. It hangs from the link `tool_mount` on the arm's flange, whose
axes are the world's when its roll, pitch and yaw are 0{home}: x forward, y left, z up. The arm is above
it, so the tool extends toward -z. What hangs from `tool_mount` must touch the flange, a disc of
{diameter:g} mm diameter and {thickness:g} mm thickness centred at its origin and square to z."""

_GRIPPER_MOUNT = """\
The tool is a pair of attachments to the gripper's fingers, which open and close them: the left part hangs from the link
`left_finger`, the right part from `right_finger`; each must touch its finger. The frames part says how their axes lie.
{fingers}
The inner faces are {gap} m apart when the gripper is open, and {closed}."""


def _rigid_mount(task: Task) -> str:
    robot, disc = task.robot, task.robot.flange.disc
    return _RIGID_MOUNT.format(
        place=" and takes the place of the gripper" if robot.gripper else "",
        home=", as they are at home" if np.allclose(task.home.rpy, 0.0, atol=1e-3) else "",
        diameter=2000 * disc.radius,
        thickness=1000 * disc.length,
    )


def _gripper_mount(robot: Robot) -> str:
    gap = finger_gap(robot)
    closed = max(0.0, gap - 2 * robot.opening_m)
    return _GRIPPER_MOUNT.format(
        fingers="\n".join(map(_finger, fingers_of(robot))),
        gap=short_number(gap, 3),
        closed="meet when it is closed" if closed < _MEET_M else f"{short_number(closed, 3)} m when it is closed",
    )


def _finger(finger: Finger) -> str:
    ends = zip("xyz", *finger.extent, strict=True)
    space = ", ".join(f"{axis} {short_number(low, 4)} to {short_number(high, 4)}" for axis, low, high in ends)
    tip, inner = (f"{_axis(way)[1]} = {short_number(finger.face(way), 4)}" for way in (finger.tip, -finger.opens))
    faces = f"tip at {tip}, inner face at {inner}"
    return f"- In its frame `{finger.name}` takes up {space}; {faces}, opens toward {_axis(finger.opens)}."


def _axis(way: Array) -> str:
    """Name an axis (3,), perhaps reversed, such as +y."""
    at = int(np.abs(way).argmax())
    return f"{'-' if way[at] < 0 else '+'}{'xyz'[at]}"


def finger_gap(robot: Robot) -> float:
    """Measure the way between the inner faces of the fingers of the open gripper, metres."""
    left, right = fingers_of(robot)
    return float((left.place(-left.opens) - right.place(-right.opens)) @ left.pose.rotation.apply(left.opens))
