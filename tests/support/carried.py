"""Exports that are carried out without an arm."""

from dataclasses import dataclass, field

import numpy as np

from core.design import Candidate
from core.interfaces import RolloutSettings
from plugins.actions.anchored import AnchoredActions
from plugins.results.workshop.policy import ExportedPlan, Stopped
from tests.support.guarded_blocks import TOOL, TOP
from tests.support.playing import Made
from tests.support.seen_cubes import CUBES

UPRIGHT = [1.0, 0.0, 0.0, 0.0]


PUSH_N = 20.0


TOUCH_Z = TOP + 0.2 + 0.004  # the block is 4 mm higher than the plan takes it to be


def exported(task, *steps, **settings):
    plan = AnchoredActions().parse(list(steps), gripper=False)
    candidate = Candidate(TOOL, plan, 0, 0, 0, 0)
    return ExportedPlan(Made(task), candidate, 0, RolloutSettings(**settings), 100.0)


@dataclass
class Exact:
    """An arm that follows exactly.

    Attributes:
        places: of the mount, where moves ended.
        seconds: that the moves took.
    """

    arm: object
    places: list = field(default_factory=list)
    seconds: float = 0.0

    def move_until(self, move):
        rows = zip(move.samples.times.tolist(), move.samples.positions, strict=True)
        stopped = None
        for time, joints in rows:
            force = np.zeros(3)
            if self.arm.forward(joints).position[2] < TOUCH_Z:
                force[2] = PUSH_N
            if move.has_fired(time, joints, force):
                stopped = Stopped(joints, time)
                break

        self.seconds += time
        self.places.append(self.arm.forward(joints).position)
        return stopped


def cubes(**places):
    seen = {name: [*place, 0.02, *UPRIGHT] for name, place in CUBES.items()}
    return seen | {name: [*xy, 0.02, *UPRIGHT] for name, xy in places.items()}
