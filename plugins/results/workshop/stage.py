"""Play motions of the arm that stands in the lab in the engines, where it may be simulated larger."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from core.design import Tool
from core.interfaces import Condition, JointTrajectory
from core.scene import Scene
from plugins.results.workshop.dry_run import DryRun
from plugins.results.workshop.life_size import Ratio, to_life
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.replay import Playable, PlayedMotion, play_motion


@dataclass(frozen=True, eq=False)
class Stage:
    """Where a motion is played: a layout of a task, in each engine.

    Tools, motions and what comes of them are in the size of the arm that stands in the lab; the stage converts them to
    the simulated size and back. A `DryRun` alone is in the simulated size.

    Attributes:
        conditions: by engine.
        scene: of the layout, with what the tool brings to it, in the simulated size.
    """

    conditions: Mapping[str, Condition]
    scene: Scene

    @property
    def first(self) -> Condition:
        """The condition in the first engine."""
        return next(iter(self.conditions.values()))

    @property
    def to_life(self) -> Ratio:
        """What leads from the simulated size to the arm's own one."""
        return to_life(self.first.task.shared().robot)

    def play_in(self, engine: str, tool: Tool, motion: Playable) -> PlayedMotion:
        """Play a motion in an engine; see `play_motion`."""
        simulated = self.to_life.inverse.tool(tool)
        played = play_motion(
            self.conditions[engine], self.scene, simulated, self._enlarge(motion)
        )
        if self.to_life.length == 1:
            return played

        contact_s = played.contact_s
        return replace(
            played,
            recording=self.to_life.recording(played.recording, tool),
            contact_s=None if contact_s is None else self.to_life.time * contact_s,
        )

    def _enlarge(self, motion: Playable) -> Playable:
        match motion:
            case Sampled():
                return self.to_life.inverse.samples(motion)
            case JointTrajectory():
                return self.to_life.inverse.trajectory(motion)
            case DryRun():
                return motion

    def play(self, tool: Tool, motion: Playable) -> dict[str, PlayedMotion]:
        """Play a motion in each engine; see `play_motion`."""
        return {name: self.play_in(name, tool, motion) for name in self.conditions}

    def rewards(self, tool: Tool, motion: Playable) -> dict[str, float]:
        """Return what a motion earns in each engine."""
        played = self.play(tool, motion)
        return {name: replay.reward for name, replay in played.items()}
