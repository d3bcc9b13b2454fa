"""Make the arms that are built in, from ``arms.yaml``."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, reduce
from importlib.resources import files
from typing import Any

import yaml

from core.geometry import Pose
from core.interfaces import ISO_9409_1_50, Gripper, Robot
from plugins.robots.example_robots import mend
from plugins.robots.programs import program

_HERE = files(__package__)


@cache
def _arms() -> dict[str, Any]:
    text = _HERE.joinpath("arms.yaml").read_text(encoding="utf-8")
    arms: dict[str, Any] = _freeze(yaml.safe_load(text))
    return arms


def _factory(name: str) -> Callable[[], Robot]:
    def make() -> Robot:
        arm = dict(_arms()[name])
        file = arm.pop("description")
        changes = arm.pop("mended", {})
        mount = _pose(arm.pop("mount"))
        angles: Any = {
            key: math.radians(degrees) for key, degrees in arm.pop("flange", {}).items()
        }
        hand = dict(arm.pop("gripper", {}))
        return Robot(
            name=name,
            description=mend(file, **changes),
            mount=mount,
            flange=replace(ISO_9409_1_50, **angles),
            gripper=Gripper(mount=_pose(hand.pop("mount")), **hand) if hand else None,
            measured=measured(name),
            programs=tuple(map(program, arm.pop("programs", ()))),
            drivers=tuple(
                (driver, program(f"drive_{driver}.py")[1])
                for driver in arm.pop("drivers", ())
            ),
            **arm,
        )

    return make


panda, fr3, ur5, ur10, xarm7, kinova, z1 = map(
    _factory, ("panda", "fr3", "ur5", "ur10", "xarm7", "kinova", "z1")
)


def measured(name: str) -> dict[str, dict[str, float | None]]:
    """Read what ``tests.benchmarks.exactness`` measured of a robot, by engine and figure; empty if it was not."""
    file = _HERE.joinpath("measured", f"{name}.json")
    return json.loads(file.read_text("utf-8")) if file.is_file() else {}


def _freeze(value: Any) -> Any:
    """Make tuples of lists."""
    if isinstance(value, dict):
        return {key: _freeze(item) for key, item in value.items()}
    if isinstance(value, list):
        return tuple(map(_freeze, value))

    return value


def _pose(steps: Sequence[Sequence[float]]) -> Pose:
    poses = []
    for x, y, z, *degrees in steps:
        roll, pitch, yaw = map(math.radians, degrees)
        poses.append(Pose.xyz_rpy((x, y, z), (roll, pitch, yaw)))

    return reduce(Pose.__matmul__, poses)
