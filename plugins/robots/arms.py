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
from plugins.robots.descriptions import description, mended
from plugins.robots.programs import program

_HERE = files(__package__)


@cache
def _arms() -> dict[str, Any]:
    arms: dict[str, Any] = yaml.safe_load(
        _HERE.joinpath("arms.yaml").read_text(encoding="utf-8")
    )
    return {
        name: {key: _tuple(value) for key, value in arm.items()}
        for name, arm in arms.items()
    }


def _factory(name: str) -> Callable[[], Robot]:
    def make() -> Robot:
        arm = dict(_arms()[name])
        file = arm.pop("description")
        changes = arm.pop("mended", {})
        mount = _pose(arm.pop("mount"))
        angles: Any = {
            key: math.radians(degrees) for key, degrees in arm.pop("flange", {}).items()
        }
        hand = {key: _tuple(value) for key, value in arm.pop("gripper", {}).items()}
        return Robot(
            name=name,
            urdf=mended(file, **changes) if changes else description(file),
            mount=mount,
            flange=replace(ISO_9409_1_50, **angles),
            gripper=Gripper(mount=_pose(hand.pop("mount")), **hand) if hand else None,
            measured=measured(name),
            programs=tuple(map(program, arm.pop("programs", ()))),
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


def _tuple(value: Any) -> Any:
    return tuple(map(_tuple, value)) if isinstance(value, list) else value


def _pose(steps: Sequence[Sequence[float]]) -> Pose:
    return reduce(
        Pose.__matmul__,
        (Pose.xyz_rpy(step[:3], tuple(map(math.radians, step[3:]))) for step in steps),
    )
