"""Play a sampled motion in an engine, and measure what it earns there.

Covered by `tests/plugins/results/workshop/test_export.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from core.design import Tool
from core.errors import UserError
from core.interfaces import Recording, Rollout, RolloutSettings, Simulator, Task
from core.scene import Scene, State
from core.solids.contacts import Contacts, find_contacts, make_trace
from core.solids.penetration import findings
from core.task import reward_of
from plugins.results.workshop.motion import Sampled

RECORD_HZ = 100.0


class Unplayable(UserError):
    """The rollout of an exported motion failed."""


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """What a motion earned in an engine, and what was seen; ``problems`` name what passed through something."""

    reward: float
    recording: Recording
    contacts: Contacts
    problems: tuple[str, ...]

    def first_contact(self) -> float | None:
        """Return when the robot first touches a body, seconds of the motion; None if it never does."""
        return min((contact.first_s for contact in self.contacts.all if contact.kind != "body"), default=None)


def play(
    task: Task, simulator: Simulator, tool: Tool, motion: Sampled, scene: Scene, seed: int, settings: RolloutSettings
) -> PlayedMotion:
    """Play a motion from its first sample, in the layout of ``seed``.

    Raises:
        Unplayable: the rollout fails.
    """
    hold = max(settings.hold_s, task.hold_s)
    job = Rollout(tool, motion.trajectory, seed, settings.settle_s, hold, RECORD_HZ, forces=True)
    (outcome,) = simulator.rollout(task, [job])
    if outcome.error is not None or outcome.start is None or outcome.end is None or outcome.recording is None:
        raise Unplayable(f"the exported motion can't be played: {outcome.error or 'the engine returned no recording'}")
    start, end = (scene.complete(State.stack([state])) for state in (outcome.start, outcome.end))
    contacts = find_contacts(scene, task.robot, tool, outcome.recording)
    trace = make_trace(scene, [contacts]) if task.reads_trace else None
    reward = float(np.asarray(reward_of(task, start, end, trace))[0])
    seen = findings(scene, task.robot, tool, outcome.recording)
    problems = tuple(finding.text for finding in seen if finding.penetration)
    return PlayedMotion(0.0 if problems else reward, outcome.recording, contacts, problems)
