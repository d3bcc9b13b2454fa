"""Write a tool as a list of boxes, ten numbers each, instead of URDF."""

import math

from core.design import Component, DesignError, Tool
from core.geometry import Box, Pose
from core.interfaces import ToolRepresentation

NUMBERS = ("parent", "x", "y", "z", "roll", "pitch", "yaw", "length", "width", "height")


class Numbers(ToolRepresentation):
    """One field, ``boxes``. Parents: 0 is the mount (or left finger), -1 the right finger, n the n-th box."""

    def schema(self):
        box = {
            "type": "array",
            "items": {"type": "number"},
            "minItems": 10,
            "maxItems": 10,
        }
        return {"boxes": {"type": "array", "items": box, "minItems": 1}}

    def instructions(self, brief):
        mounts = (
            "0 for the left finger, -1 for the right one"
            if brief.gripper
            else "0 for the flange"
        )
        return (
            f"A tool is `boxes`, a list of lists of ten numbers: {', '.join(NUMBERS)}. The parent is {mounts}, or the "
            "number of a box before this one, counted from 1; the box must touch it. Metres and radians, in the frame "
            "of the parent; sizes are full lengths."
        )

    def parse(self, data, *, gripper):
        if not isinstance(data.get("boxes"), list):
            raise DesignError(
                "boxes is missing, or no list; give a list of boxes of ten numbers"
            )
        mounts = Tool(gripper=gripper).mounts
        names = dict(zip((0, -1), mounts, strict=False))
        components = []
        for number, box in enumerate(data["boxes"], start=1):
            parent, pose, shape = read(number, box, names)
            components.append(Component(f"box{number}", parent, pose, shape))
            names[number] = f"box{number}"
        return Tool(tuple(components), gripper)

    def dump(self, tool):
        numbers = dict(zip(tool.mounts, (0, -1), strict=False))
        boxes = []
        for component in tool.components:
            values = [
                *component.pose.position,
                *component.pose.rpy,
                *component.shape.size,
            ]
            boxes.append(
                [
                    numbers[component.parent],
                    *(round(float(value), 9) for value in values),
                ]
            )
            numbers[component.name] = len(boxes)
        return {"boxes": boxes}


def read(number, box, names):
    """Read a box that a model wrote: the name of its parent, its pose there, its shape."""
    where = f"box {number}"
    if not isinstance(box, list) or len(box) != len(NUMBERS):
        raise DesignError(
            f"{where} must be a list of ten numbers: {', '.join(NUMBERS)}"
        )
    for name, value in zip(NUMBERS, box, strict=True):
        sound = isinstance(value, int | float) and not isinstance(value, bool)
        if not sound or not math.isfinite(value) or abs(value) > 100:
            raise DesignError(f"{where}: {name} must be a finite number")
    if box[0] not in names:
        raise DesignError(
            f"{where}: there is no parent {box[0]}; possible: {', '.join(map(str, sorted(names)))}"
        )
    if min(box[7:]) <= 0:
        raise DesignError(f"{where}: the sizes must be greater than 0")
    return (
        names[box[0]],
        Pose.xyz_rpy(box[1:4], box[4:7]),
        Box(tuple(map(float, box[7:]))),
    )
