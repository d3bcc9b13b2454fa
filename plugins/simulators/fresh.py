"""Play each rollout in a fresh world, which is stepped from outside."""

from __future__ import annotations

import tempfile
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

from core.errors import check_positive
from core.geometry import Array
from core.interfaces import Ability, Order, Pushes, Robot, Rollout, World
from core.scene import Scene, State
from core.simulation.engines import SteppingSimulator
from core.support.scratch import scratch
from core.values.grips import Gripped
from plugins.simulators.bonds import Bonds
from plugins.simulators.forces import Impulses, Totals
from plugins.simulators.grips import Grips
from plugins.simulators.step_lengths import check_time_step, choose_step

Prepared = TypeVar("Prepared")


_Note = tuple[Any, Totals | None, int]
"""A snapshot (`FreshWorld.snapshot`), the impulses' totals, and how many steps the bonds have seen.

Without impulses or bonds it is None or 0. A rollout has thousands, and a named tuple takes nine times as long to make.
"""


class FreshWorld(World):
    """A world with one job's robot and scene.

    Attributes:
        impulses: sums up those of contacts; None: they are not asked for.
        bonds: those of the scene; None: it has none.
        gripping: the grips of the tool; None: it has none.
    """

    impulses: Impulses | None = None
    bonds: Bonds | None = None
    gripping: Grips | None = None
    tells_torques = True

    @abstractmethod
    def snapshot(self) -> Any:
        """Take a snapshot of the joints and free bodies, in the form that is fastest to get."""

    @abstractmethod
    def decode(self, snapshots: Sequence[Any]) -> tuple[Array, Array, State]:
        """Decode T snapshots, see `World.read`."""

    def end_step(self, order: Order) -> None:
        """Note what the last step did to contacts, bonds and grips; call it after each step."""
        if self.impulses is not None:
            self.impulses.add_step()
        if self.bonds is not None:
            self.bonds.end_step()
        if self.gripping is not None:
            self.gripping.end_step(self, order.fingers)

    def note(self) -> _Note:
        totals = self.impulses.totals() if self.impulses else None
        steps = self.bonds.steps if self.bonds else 0
        return self.snapshot(), totals, steps

    def read(self, notes: Sequence[_Note]) -> tuple[Array, Array, State]:
        return self.decode([snapshot for snapshot, _, _ in notes])

    def contact_forces(
        self, notes: Sequence[_Note], instants: Array
    ) -> tuple[Mapping[tuple[str, str], Array], Pushes | None]:
        assert self.impulses is not None
        totals = [known for _, known, _ in notes if known is not None]
        return self.impulses.mean_forces(totals, instants)

    def loads(self, notes: Sequence[_Note]) -> Mapping[str, Array]:
        if self.bonds is None:
            return {}
        return self.bonds.loads([steps for _, _, steps in notes])

    def grips(self) -> tuple[Gripped, ...]:
        return () if self.gripping is None else self.gripping.report()

    def state(self) -> State:
        """Read the state of the free bodies."""
        _, _, states = self.decode([self.snapshot()])
        return states[0]


class FreshWorlds(SteppingSimulator, Generic[Prepared]):
    """Play each job in a world of its own, so that no rollout affects the next.

    Attributes:
        folder: for files, which goes with the simulator.

    Args:
        time_step: seconds.
        settings: others, which must be above 0, too.
    """

    supports = frozenset(Ability) - {Ability.SOFT_BODIES, Ability.FORKS}

    def __init__(self, time_step: float, **settings: float) -> None:
        check_positive("sim.", **settings)
        check_time_step(time_step)
        self._time_step = time_step
        # It is removed with the process's own: a forked one leaves it alone.
        self.folder = Path(tempfile.mkdtemp(dir=scratch()))
        # That of the last job, since consecutive jobs mostly share it.
        self._prepared: tuple[Scene, Prepared] | None = None

    @abstractmethod
    def prepare(self, scene: Scene) -> Prepared:
        """Prepare a scene to be placed in one world after another."""

    def choose_time_step(self, scene: Scene) -> float:
        """Return the time step that a scene's bodies need, s."""
        return self._time_step

    @abstractmethod
    def place(
        self, prepared: Prepared, robot: Robot, job: Rollout, time_step: float
    ) -> FreshWorld:
        """Build a job's world, with the time step, s, that its scene and tool need."""

    def build(self, robot: Robot, scene: Scene, job: Rollout) -> FreshWorld:
        if self._prepared is None or self._prepared[0] is not scene:
            self._prepared = (scene, self.prepare(scene))

        usual = self.choose_time_step(scene)
        time_step = choose_step(job.tool, scene, usual, job.steps_hz)
        return self.place(self._prepared[1], robot, job, time_step)
