"""Play motions of the arm that stands in the lab in the engines, where it may be simulated larger."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from core.design import Candidate, Tool
from core.designs.planning import resolve
from core.interfaces import Condition, JointTrajectory, Motion
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_task_motion
from core.scene import Scene
from plugins.results.workshop.life_size import Ratio, to_life
from plugins.results.workshop.motion import Sampled, sample
from plugins.results.workshop.policy import ExportedPlan
from plugins.results.workshop.replay import Playable, PlayedMotion, play_motion


@dataclass(frozen=True, eq=False)
class PlayedDesign:
    """The motion of a design as it is exported, and what came of it in each engine; see `Export`."""

    planned: Motion
    motion: Sampled
    replays: dict[str, PlayedMotion]
    dry_run: ExportedPlan | None = None


@dataclass(frozen=True, eq=False)
class Stage:
    """Where a motion is played: a layout of a task, in each engine.

    Tools, motions and what comes of them are in the size of the arm that stands in the lab; the stage converts them to
    the simulated size and back. An `ExportedPlan` alone is in the simulated size.

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
        enlarge = self.to_life.inverse
        if isinstance(motion, JointTrajectory):
            motion = enlarge.trajectory(motion)
        condition = self.conditions[engine]
        played = play_motion(condition, self.scene, enlarge.tool(tool), motion)
        if self.to_life.length == 1:
            return played

        contact_s = played.contact_s
        return replace(
            played,
            recording=self.to_life.recording(played.recording, tool),
            contact_s=None if contact_s is None else self.to_life.time * contact_s,
        )

    def play(self, tool: Tool, motion: Playable) -> dict[str, PlayedMotion]:
        """Play a motion in each engine; see `play_motion`."""
        return {name: self.play_in(name, tool, motion) for name in self.conditions}

    def rewards(self, tool: Tool, motion: Playable) -> dict[str, float]:
        """Return what a motion earns in each engine."""
        played = self.play(tool, motion)
        return {name: replay.reward for name, replay in played.items()}

    def play_design(
        self, candidate: Candidate, tool: Tool, rate_hz: float, speed: float = 1.0
    ) -> PlayedDesign:
        """Play the motion of a design as it is exported, in each engine.

        Args:
            candidate: with the plan for the task.
            tool: its tool, in the size of the arm in the lab.
            rate_hz: of the samples.
            speed: the share of the planned speed.

        Raises:
            UserError: it can't be sampled or played.
            DesignError: the plan means nothing in this layout.
        """
        condition = self.first
        task = condition.task.shared()
        arm = arm_of(task.robot.life_size)
        settings = condition.settings
        layout = condition.layout
        waypoints = resolve(candidate.plan, task, layout, settings, self.scene)

        if waypoints.guards or waypoints.looks:
            simulated_hz = rate_hz * self.to_life.time
            plan = ExportedPlan(
                condition.task, candidate, layout, settings, simulated_hz, speed
            )
            replays = self.play(tool, plan)
            # As it went in the first engine.
            reactions = next(iter(replays.values())).reactions
            assert reactions is not None
            planned = self.to_life.motion(reactions.motion)
            motion = sample(planned.trajectory, arm, rate_hz, speed)
            return PlayedDesign(planned, motion, replays, plan)

        planned = self.to_life.motion(plan_task_motion(waypoints, task, settings))
        motion = sample(planned.trajectory, arm, rate_hz, speed)
        return PlayedDesign(planned, motion, self.play(tool, motion.trajectory))
