"""One's own arm, from a URDF or Xacro file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from core.interfaces import Robot
from core.robot.reading import PAYLOAD_KG, GripperOptions, read_robot


def urdf(
    path: str,
    home: list[float] | dict[str, float],
    flange: str | None = None,
    title: str = "",
    mount_rpy: tuple[float, float, float] | None = None,
    payload_kg: float = PAYLOAD_KG,
    acceleration: list[float] | None = None,
    motor_inertia: list[float] | None = None,
    gripper: GripperOptions | None = None,
    fixed: list[str] | None = None,
    without: list[str] | None = None,
    arguments: Mapping[str, str] | None = None,
) -> Robot:
    """The arm between a description's base and ``flange``; see `core.robot.reading.read_robot` for the settings."""
    return read_robot(
        Path(path),
        home,
        flange,
        title=title,
        mount_rpy=mount_rpy,
        payload_kg=payload_kg,
        acceleration=acceleration,
        motor_inertia=motor_inertia,
        gripper=gripper,
        fixed=fixed or (),
        without=without or (),
        arguments=arguments,
    )
