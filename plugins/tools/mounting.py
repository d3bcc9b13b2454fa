"""Write the instructions of every tool representation, by templates; and describe the mounts that tools hang from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from core.design import RIGID_MOUNT, Tool
from core.designs import rules, statics
from core.geometry import Array
from core.interfaces import Brief, Robot
from core.robot.extents import fingers_of
from core.support.templates import fill
from core.support.text import short_number
from core.values.materials import Material
from core.values.printers import Printer
from plugins.tools import joint_rules


def describe_mount(brief: Brief) -> str:
    """Write which links the tool hangs from, where their axes point, and what must be touched."""
    robot = brief.task.robot
    upright = np.allclose(brief.task.home.rpy, 0.0, atol=1e-3)
    if not brief.gripper:
        return _write("mount", gripper=False, robot=robot, upright=upright)

    gap = finger_gap(robot)
    return _write(
        "mount",
        gripper=True,
        fingers=fingers_of(robot),
        axis_of=_axis,
        short=short_number,
        gap=gap,
        closed=gap - 2 * robot.opening_m,
    )


def instruct(template: str, brief: Brief, material: Material, **given: Any) -> str:
    """Write how a model writes tools of a material.

    Args:
        template: its name.
        brief: what is asked for.
        material: of the tools.
        given: more that the template names.
    """
    robot = brief.task.robot
    weight = ""

    if material.density_kg_m3 is not None:
        weight = describe_weight(material, robot, brief.representation.printer)

    return _write(
        template,
        mount=describe_mount(brief),
        frame=" or ".join(f"`{mount}`" for mount in Tool(gripper=brief.gripper).mounts),
        elites=brief.elites,
        weight=weight,
        payload=statics.mass_limit(robot, material)[0],
        share=joint_rules.spring_share(material),
        **given,
    )


def describe_weight(material: Material, robot: Robot, printer: Printer) -> str:
    """Write the part of a prompt that says what tools of a real material weigh and may weigh, and what a printer makes.

    These are list items.
    """
    return _write(
        "weight",
        material=material,
        payload=statics.mass_limit(robot, material)[0],
        moment=statics.moment_limit(robot),
        gravity=statics.GRAVITY,
        printer=printer,
        plate=" x ".join(f"{side:g}" for side in printer.plate_mm),
    )


def _write(template: str, /, **given: Any) -> str:
    """Fill in a template, which finds the limits of tools and of their joints by the names of their rules."""
    limits = {**vars(rules), **vars(joint_rules)}
    return fill("plugins.tools", template, **{**limits, **given})


@dataclass(frozen=True)
class ExampleBox:
    """A box for an example, along the axes of its mount: its size (3,) and the place of its centre (3,), metres."""

    mount: str
    name: str
    size: Array
    place: Array


def first_box(brief: Brief) -> ExampleBox:
    """Make a shaft at the flange, or a pad on the inside of the left finger's tip."""
    robot = brief.task.robot

    if not brief.gripper:
        size = np.array([0.02, 0.02, 0.1])
        below = (robot.flange.disc.length + size[2]) / 2
        return ExampleBox(RIGID_MOUNT, "shaft", size, np.array([0.0, 0.0, -below]))

    finger = fingers_of(robot)[0]
    out = np.abs(finger.opens)
    down = np.abs(finger.tip)
    across = 1 - out - down
    size = 0.02 * across + 0.015 * out + 0.04 * down
    place = np.mean(finger.extent, axis=0) * across
    place += (
        out * finger.face(-finger.opens)
        + 0.0075 * finger.opens
        + down * finger.face(finger.tip)
    )
    place += 0.0155 * finger.tip  # it overlaps the finger by 4.5 mm

    return ExampleBox(finger.name, "left_pad", size, place)


def _axis(way: Array) -> str:
    """Name an axis (3,), perhaps reversed, such as +y."""
    axis = int(np.abs(way).argmax())
    sign = "-" if way[axis] < 0 else "+"

    return sign + "xyz"[axis]


def finger_gap(robot: Robot) -> float:
    """Measure the way between the inner faces of the fingers of the open gripper, metres."""
    left, right = fingers_of(robot)
    between = left.place(-left.opens) - right.place(-right.opens)

    return float(between @ left.pose.rotation.apply(left.opens))
