"""Play an exported plan in an engine: the engine is the arm, its camera, and what the arm feels."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from core.design import Tool
from core.designs.planning import resolve
from core.geometry import Array, step_lengths
from core.interfaces import (
    Felt,
    JointTrajectory,
    Look,
    Looked,
    Motion,
)
from core.robot.feeling import ForceSense, bring_to_rest
from core.scene import Scene, State
from core.simulation.looking import Lookout
from core.values.jobs import FEEL_S
from plugins.results.workshop.policy import (
    ExportedPlan,
    Move,
    Policy,
    Stopped,
)


class DryReactions:
    """Carries a plan out in one world, as the playback asks for (`core.interfaces.Reactions`).

    Args:
        exported: the plan; its layout is the seed of the noise of what is felt.
        scene: of the layout.
        tool: that the arm holds there.

    Attributes:
        felt: how guards ended so far.
        looked: what looks found out so far.
        problem: why the rest could not be planned; the plan ended there.
        since: from when on the arm feels for the next guard, seconds; inf: there is none.
        looks_at: when a move without a guard ends, or the scene is looked at, seconds; inf: neither comes next.
    """

    feels = True
    looks = True

    def __init__(self, exported: ExportedPlan, scene: Scene, tool: Tool) -> None:
        task = exported.task.shared()
        layout = exported.layout
        settings = exported.settings
        plan = exported.candidate.plan
        self._exported = exported
        self._meaning = partial(resolve, plan, task, layout, settings, scene)
        self._eyes = Lookout(task, scene, tool, layout, settings)

    def begin(self) -> JointTrajectory:
        """See `core.interfaces.Reactions`."""
        self.felt: tuple[Felt, ...] = ()
        self.looked: tuple[Looked, ...] = ()
        self.problem: str | None = None
        self.since = math.inf
        self.looks_at = math.inf
        self._policy = Policy(self._meaning, self._exported)
        noise = self._exported.settings.feel.noise
        self._sense = ForceSense(self._exported.arm, noise, self._exported.layout)
        self._look: Look | None = None
        self._move: Move | None = None
        self._rows: list[Array] = []
        self._arrivals: list[float] = []
        move = self._policy.begin()
        self._trajectory = move.trajectory
        self._follow(move, 0.0)

        return self._trajectory

    @property
    def motion(self) -> Motion:
        """The motion as it was played so far."""
        count = len(self._arrivals)
        places = self._exported.arm.positions(self._trajectory.arm)
        return Motion(
            self._trajectory,
            float(step_lengths(places).sum()),
            np.array(self._arrivals),
            np.zeros((count, 2)),
            np.array(self._rows),
            np.ones(count),
        )

    def _follow(self, move: Move, begins_s: float) -> None:
        """Follow a move, which begins at an instant of the motion."""
        self._move = move
        self._begins_s = begins_s
        self._rows += list(move.motion.plan)
        self._arrivals += (begins_s + move.arrivals).tolist()
        if move.guard is None:
            self.looks_at = self._trajectory.duration
        else:
            self.since = begins_s + move.since_s

    def feel(
        self, time: float, arm: Array, points: Array, forces: Array
    ) -> JointTrajectory | None:
        """Take a reading, see `core.interfaces.Reactions`."""
        move = self._move
        if move is None or move.watch is None:
            return None

        force = self._sense.estimate(arm, points, forces)
        within = time - self._begins_s
        fired = move.has_fired(within, arm, force)
        if not fired and time < self._trajectory.duration - 2 * FEEL_S:
            return None

        what = move.watch.guard.until if fired else ""
        newtons = float(np.linalg.norm(move.watch.force))
        self.felt += (Felt(len(self._rows), time, what, newtons),)
        stopped = None
        if fired:
            stopped = Stopped(arm, within)
            self._trajectory = bring_to_rest(
                self._trajectory,
                time,
                arm,
                self._exported.arm,
                self._exported.settings.speed,
            )
            self._arrivals[-1] = self._trajectory.duration

        self._take(self._policy.moved(stopped))
        return self._trajectory

    def look(
        self, time: float, arm: Array, fingers: Array, state: State
    ) -> JointTrajectory | None:
        """Look at the world where a move ended, if the plan does, see `core.interfaces.Reactions`."""
        if self._look is None:
            self._take(self._policy.moved(None))
            return self._trajectory

        before = self._policy.looks
        seen = self._eyes.look(time, arm, fingers, state, before)
        self.looked += (self._eyes.report(self._look, (*before, seen)),)
        look_s = self._exported.settings.perception.look_s
        rest_s = max(time + look_s - self._trajectory.duration, FEEL_S)
        self._trajectory = self._trajectory.held(rest_s)
        self._take(self._policy.saw(seen))

        return self._trajectory

    def _take(self, step: Move | Look | None) -> None:
        """Take what comes next, from the end of the motion until now."""
        begins_s = self._trajectory.duration
        self.problem = self._policy.problem
        self._move = None
        self._look = None
        self.since = math.inf
        self.looks_at = math.inf

        if isinstance(step, Look):
            self._look = step
            self.looks_at = begins_s
        elif step is not None:
            added = step.trajectory
            self._trajectory = self._trajectory.extended(
                added.times[1:], added.arm[1:], added.fingers[1:]
            )
            self._follow(step, begins_s)
