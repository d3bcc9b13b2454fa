"""Name a part with its settings, so that each worker process can make its own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Generic

from pydantic import FiniteFloat
from typing_extensions import TypeVar

from core.errors import UsageError
from core.geometry import Pose
from core.interfaces import Robot
from core.plugins.kinds import KINDS
from core.plugins.registry import installed
from core.support.files import noting_reads
from core.support.inputs import check
from core.support.progress_display import busy
from core.values.materials import PAPER, Material
from core.values.printers import MK4, Printer

T_co = TypeVar("T_co", covariant=True, default=Any)
_BASE: Any = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]


@dataclass(frozen=True)
class PluginPart(Generic[T_co]):
    """A part by name and settings, from which a worker process makes its own; ``PluginPart[Task]`` makes a `Task`.

    A task or tool representation is made for ``robot`` (None: the default robot), weighs by ``material``, and has its
    tools made by ``printer``. A robot stands at ``base``: x, y, z in metres, and yaw in radians; empty or 0: where
    it says itself.
    """

    kind: str
    name: str
    settings: tuple[tuple[str, Any], ...] = ()
    robot: PluginPart[Robot] | None = None
    material: Material = PAPER
    printer: Printer = MK4
    base: Any = ()

    def __hash__(self) -> int:  # settings may be lists and mappings
        return hash((self.kind, self.name))

    def create(self, **given: Any) -> T_co:
        """Make the part; what is ``given`` goes to its factory beside the settings.

        Raises:
            UserError: a setting that can't be used.
        """
        robot = self.robot and self.robot.shared()
        settings = dict(self.settings)
        environment = {
            "robot": robot,
            "material": self.material,
            "printer": self.printer,
            **given,
        }
        with busy(f"making {self.kind} {self.name}"):
            part: Any = installed().create(
                KINDS[self.kind], self.name, settings, **environment
            )
        if self.pose != Pose():
            part = replace(part, base=self.pose)
        return part  # type: ignore[no-any-return]

    @property
    def pose(self) -> Pose:
        """The pose of a robot's base in the world.

        Raises:
            UsageError: ``base`` is not four finite numbers.
        """
        if not self.base:
            return Pose()
        what = f"robot.base must be four numbers, [x, y, z, yaw], got {self.base}"
        x, y, z, yaw = check(_BASE, self.base, what, UsageError)
        return Pose.xyz_rpy((x, y, z), (0.0, 0.0, yaw))

    def shared(self) -> T_co:
        """Return the part, which a process makes once; so what is computed from a robot is found again."""
        part: T_co = _shared(self)[0]
        return part

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of others that were read to make the part, but for its robot."""
        return _shared(self)[1]

    def declared(self, name: str, default: Any) -> Any:
        """Return an attribute of the part's class, without making the part."""
        return getattr(installed().factory(self.kind, self.name), name, default)


@lru_cache(maxsize=256)
def _shared(part: PluginPart) -> tuple[Any, tuple[Path, ...]]:
    """Make a part, and note what was read for it."""
    if part.robot is not None:
        part.robot.shared()

    with noting_reads() as files:
        made = part.create()

    return made, tuple(files)
