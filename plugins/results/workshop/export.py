"""What is exported of a task: a motion, what it earned in each engine, and what the arm has to bear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from core.design import Candidate
from core.interfaces import Motion, Task
from core.scene import Scene
from core.values.robots import Robot
from plugins.results.workshop.clearance import (
    NEAR_M,
    Nearest,
    clearance,
    margins,
    payload,
)
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.policy import ExportedPlan
from plugins.results.workshop.printing import Check
from plugins.results.workshop.replay import Playable, PlayedMotion
from plugins.results.workshop.strength import Strength
from plugins.results.workshop.tool import PrintedTool


@dataclass(frozen=True, eq=False)
class Export:
    """The motion of a tool in a task, what it earned in each engine, and what the arm has to bear.

    All of it is in the size of the arm that stands in the lab, but for ``candidate``, ``dry_run`` and ``settings``.

    Attributes:
        robot: the arm that stands in the lab.
        scene: the layout.
        candidate: as it was searched.
        planned: the motion as it was searched.
        moves: the motion as it is exported, and what leads to it, by the names of their files.
        replays: what it earned, by engine, and ``mounted``: with what fixes the tool to the arm.
        contact_s: when the robot first touches a body, in any engine; None: never.
        strengths: what the tool's components bear; none of the bare hand.
        checks: of the motion; ``verdicts``: of the tool, too.
        dry_run: plays a plan that feels or looks; None: it does neither. Its motion is then that of the first engine.
        settings: from which an export's plan can be made again (`plugins.results.workshop.carrying`).
    """

    task: Task
    robot: Robot
    scene: Scene
    candidate: Candidate
    planned: Motion
    moves: Mapping[str, Sampled]
    replays: Mapping[str, PlayedMotion]
    contact_s: float | None
    printed: PrintedTool
    strengths: Sequence[Strength]
    mounted: Mapping[str, float] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    verdicts: list[Check] = field(default_factory=list)
    dry_run: ExportedPlan | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def motion(self) -> Sampled:
        """The motion as it is exported."""
        return self.moves["trajectory"]

    @property
    def playable(self) -> Playable:
        """What is played to try the export."""
        return self.dry_run or self.motion.trajectory

    @cached_property
    def payload(self) -> dict[str, Any]:
        return payload(self.robot, self.printed.printed)

    @cached_property
    def limits(self) -> list[dict[str, Any]]:
        return margins(self.robot, self.printed.printed, self.motion)

    @cached_property
    def nearest(self) -> list[Nearest]:
        """Distances in the first engine."""
        first = next(iter(self.replays.values()))
        return clearance(self.scene, self.robot, self.printed.tool, first.recording)

    def figures(self) -> dict[str, Any]:
        """Return all figures as data."""
        replays = self.replays.items()
        return {
            "robot": self.robot.title,
            "candidate": self.candidate.id,
            "duration_s": float(self.motion.times[-1]),
            "slower_than_simulated": self.motion.slower,
            "first_contact_s": self.contact_s,
            "rewards": {engine: replay.reward for engine, replay in replays},
            "rewards_mounted": dict(self.mounted),
            "problems": {engine: list(replay.problems) for engine, replay in replays},
            "joints": self.limits,
            "torques": {engine: dict(replay.torques) for engine, replay in replays},
            "nearest": [row._asdict() for row in self.nearest if row.metres < NEAR_M],
            "payload": self.payload,
        }
