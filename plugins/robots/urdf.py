"""One's own arm, from a URDF file."""

import inspect
import typing

from core.interfaces import Robot
from plugins.robots.reading import read_robot
from plugins.robots.settings import ArmSettings


def urdf(**settings: typing.Any) -> Robot:
    """Make the arm between a description's base and flange; `plugins.robots.settings.ArmSettings` are the settings."""
    return read_robot(**settings)


# A configuration may set what is in the signature.
urdf.__signature__ = inspect.signature(ArmSettings)  # type: ignore[attr-defined]
urdf.__annotations__ = {**typing.get_type_hints(ArmSettings), "return": Robot}
