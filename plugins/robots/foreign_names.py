"""What names in others' files say, and the names that links and joints have here."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT
from core.robot.description import BASE, joint_name
from core.support.text import hydra_word
from core.values.descriptions import Description

# Names that links and joints of what is mounted have, and so none of an arm.
RESERVED = (
    RIGID_MOUNT,
    *GRIPPER_MOUNTS,
    BASE,
    joint_name(RIGID_MOUNT),
    joint_name(BASE),
)

_ODD = re.compile(r"[^A-Za-z0-9_.-]+")
_LONGEST = 64
_TOOL_FRAME = re.compile(r"attach|flange|tool|tcp|eef|end.?effector", re.IGNORECASE)
_SENSOR = re.compile(r"camera|optical|depth|imu|lidar|laser|sensor", re.IGNORECASE)
_JAW = re.compile(
    r"grip|jaw|finger|claw|thumb|pinch|clamp|knuckle|grasp", re.IGNORECASE
)


def write_word(setting: str, value: object) -> str:
    """Write a setting of the arm as a word to type in a shell, whatever names are in it."""
    word = f"robot.{setting}={hydra_word(value)}"
    return shlex.quote(word) if {*word} & {*"'\"{"} else word


def names_tool_frame(name: str) -> bool:
    """Tell whether a frame is for tools, by its name."""
    return bool(_TOOL_FRAME.search(name))


def names_sensor(name: str) -> bool:
    """Tell whether a frame is that of a camera or another sensor, by its name."""
    return bool(_SENSOR.search(name))


def names_jaw(*names: str) -> bool:
    """Tell whether one of the names is that of a part of a gripper."""
    return any(map(_JAW.search, names))


def _choose_names(names: Iterable[str]) -> dict[str, str]:
    """Give links or joints names that every engine reads, by those of the file, which stay where they can."""
    chosen = dict[str, str]()
    taken = {*RESERVED}
    for name in names:
        plain = _ODD.sub("_", name)[:_LONGEST]
        unused = plain
        number = 1
        while unused in taken:
            number += 1
            unused = f"{plain[: _LONGEST - 4]}_{number}"

        taken.add(unused)
        chosen[name] = unused

    return chosen


def choose_all_names(
    description: Description, notes: list[str]
) -> tuple[dict[str, str], dict[str, str]]:
    """Give links and joints names that every engine reads, and note it where one had to change."""
    links = _choose_names(description.links)
    joints = _choose_names(description.named)
    changed = [pair for pair in (*links.items(), *joints.items()) if len({*pair}) > 1]
    if changed:
        old, new = changed[0]
        notes.append(
            f"{len(changed)} names are others here, such as {new!r} for {old!r}; settings take the file's"
        )

    return links, joints
