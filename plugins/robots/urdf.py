"""One's own arm, from a URDF file."""

import inspect
import typing

from core.interfaces import Robot
from plugins.robots.arm_settings import ArmSettings
from plugins.robots.own_arm import read_robot


def urdf(**settings: typing.Any) -> Robot:
    """Make the arm between a base and a flange, with the settings `plugins.robots.arm_settings.ArmSettings`."""
    return read_robot(**settings)


# A configuration may set what is in the signature.
urdf.__signature__ = inspect.signature(ArmSettings)  # type: ignore[attr-defined]
urdf.__annotations__ = {
    **typing.get_type_hints(ArmSettings, include_extras=True),
    "return": Robot,
}
