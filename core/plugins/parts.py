"""Name a part with its settings, so that each worker process can make its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Generic

import pydantic
from typing_extensions import TypeVar

from core.errors import UsageError
from core.geometry import Pose
from core.interfaces import Robot
from core.plugins.registry import installed
from core.values.materials import PAPER, Material

T_co = TypeVar("T_co", covariant=True, default=Any)
_Number = pydantic.FiniteFloat
# X, y, z and yaw.
_BASE = pydantic.TypeAdapter(
    tuple[_Number, _Number, _Number, _Number], config={"strict": True}
)


@dataclass(frozen=True)
class PluginPart(Generic[T_co]):
    """A part by name and settings, from which a worker process makes its own; ``PluginPart[Task]`` makes a `Task`.

    A task or tool representation is made for ``robot`` (None: the default robot) and weighs by ``material``.
    """

    kind: str
    name: str
    settings: tuple[tuple[str, Any], ...] = ()
    robot: RobotPart | None = None
    material: Material = PAPER

    def __hash__(self) -> int:  # settings may be lists and mappings
        return hash((self.kind, self.name))

    def create(self, **given: Any) -> T_co:
        """Make the part; what is ``given`` goes to its factory beside the settings."""
        robot = self.robot and _robot(self.robot)
        part: T_co = installed().create(
            self.kind,
            self.name,
            dict(self.settings),
            **{"robot": robot, "material": self.material, **given},
        )
        return part

    def shared(self) -> T_co:
        """Return the part, which a process makes once."""
        part: T_co = _shared(self)
        return part

    def declared(self, name: str, default: Any) -> Any:
        """Return an attribute of the part's class, without making the part."""
        return getattr(installed().factory(self.kind, self.name), name, default)


@dataclass(frozen=True)
class RobotPart(PluginPart[Robot]):
    """A robot by name and settings, and where its base stands: x, y, z in metres, and yaw in radians."""

    base: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    __hash__ = PluginPart.__hash__

    def create(self, **given: Any) -> Robot:
        robot = super().create(**given)
        return replace(robot, base=self.pose) if any(self.base) else robot

    @property
    def pose(self) -> Pose:
        """The base's pose in the world.

        Raises:
            UsageError: ``base`` is not four finite numbers.
        """
        try:
            x, y, z, yaw = _BASE.validate_python(self.base)
        except pydantic.ValidationError as error:
            raise UsageError(
                f"robot.base must be four numbers, [x, y, z, yaw], got {list(self.base)}"
            ) from error

        if not any(self.base):
            return Pose()
        return Pose.xyz_rpy((x, y, z), (0.0, 0.0, yaw))


@lru_cache(maxsize=256)
def _shared(part: PluginPart) -> Any:
    return part.create()


@lru_cache(maxsize=16)
def _robot(part: RobotPart) -> Robot:
    """Make a robot once per process, so that what is computed from it is found again."""
    return part.create()
