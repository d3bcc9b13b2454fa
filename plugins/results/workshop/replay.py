"""Play a motion as it is exported in an engine, and keep what was seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from core.design import DesignError, Tool
from core.errors import UserError
from core.interfaces import Condition, JointTrajectory, Recording, Rollout
from core.robot.kinematics import arm_of
from core.scene import Scene
from core.solids.contacts import Contacts, find_contacts, make_trace
from core.solids.penetration import findings
from core.support.text import number
from core.task import reward_of
from core.values.torques import TorqueShare, find_hardest
from plugins.results.workshop.dry_run import DryReactions
from plugins.results.workshop.policy import ExportedPlan

RECORD_HZ = 100.0

Playable = JointTrajectory | ExportedPlan


class Unplayable(UserError):
    """The rollout of an exported motion failed."""


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """What a motion earned in an engine, and what was seen.

    Attributes:
        reward: the task's; 0 where something passed through something else.
        recording: of the rollout, with forces.
        contact_s: when the robot first touches a body, s; None: never.
        touched: the bodies that the tool touches.
        problems: what passed through something, in words.
        torques: the greatest share of its torque limit that each joint used, by name; empty: the engine does not say.
        reactions: what the plan felt and saw on its way; None: it does neither.
    """

    reward: float
    recording: Recording
    contact_s: float | None
    touched: frozenset[str]
    problems: tuple[str, ...]
    torques: Mapping[str, float] = field(default_factory=dict)
    reactions: DryReactions | None = None

    @property
    def hardest(self) -> TorqueShare | None:
        """The joint that used most of its torque."""
        return find_hardest(self.torques)

    @property
    def earned(self) -> str:
        """The reward as it is shown."""
        return number(self.reward, 3)


def play_motion(
    condition: Condition,
    scene: Scene,
    tool: Tool,
    motion: Playable,
) -> PlayedMotion:
    """Play a motion from its first sample, with forces.

    Args:
        condition: the task and the engine; its settings say how long things settle and hold.
        scene: of the condition, made once for all engines.
        tool: what the arm holds.
        motion: as it is exported, or as it was searched; or a plan that feels or looks on its way.

    Raises:
        Unplayable: the rollout fails.
    """
    task = condition.task.shared()
    settings = condition.settings
    reactions = None
    try:
        if isinstance(motion, ExportedPlan):
            reactions = DryReactions(motion, scene, tool)
            motion = reactions.begin()
        job = Rollout(
            tool,
            motion,
            condition.layout,
            settings.settle_s,
            hold_s=max(settings.hold_s, task.hold_s),
            record_hz=RECORD_HZ,
            forces=True,
            reactions=reactions,
            scene=scene,
        )
        (outcome,) = condition.sim.shared().rollout(task, [job])
    except DesignError as error:
        raise Unplayable(f"the exported motion can't be played: {error}") from error

    recording = outcome.recording
    if outcome.error is not None:
        raise Unplayable(f"the exported motion can't be played: {outcome.error}")
    if recording is None or outcome.start is None or outcome.end is None:
        raise Unplayable(
            "the exported motion can't be played: the engine returned no recording"
        )

    first = scene.complete(outcome.start)
    end = scene.complete(outcome.end)
    contacts = find_contacts(scene, task.robot, tool, recording)
    trace = make_trace(scene, contacts)[None] if task.reads_trace else None
    reward = float(np.asarray(reward_of(task, first[None], end[None], trace))[0])

    seen = findings(scene, task.robot, tool, recording)
    problems = tuple(finding.text for finding in seen if finding.penetration)
    if problems:
        reward = 0.0

    torques = arm_of(task.robot).share_torques(outcome.torques)
    return PlayedMotion(
        reward,
        recording,
        _find_first_contact(contacts),
        frozenset(key[2] for key in contacts.touching if key[0] == "tool"),
        problems,
        torques,
        reactions,
    )


def _find_first_contact(contacts: Contacts) -> float | None:
    """Find when the robot first touches a body, s; None: never."""
    times = contacts.taken.times
    return min(
        (
            float(times[touched.argmax()])
            for (kind, *_), touched in contacts.touching.items()
            if kind != "body"
        ),
        default=None,
    )
