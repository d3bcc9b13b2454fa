"""Sample a motion with what leads to it and back, and look whether these ways are free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from omegaconf import DictConfig

from core.geometry import Array
from core.interfaces import JointTrajectory, Recording, Robot
from core.robot.kinematics import arm_of
from core.solids.self_collision import DEEP_M
from core.support.templates import macros
from plugins.results.workshop.clearance import HZ, clearance
from plugins.results.workshop.export import Export
from plugins.results.workshop.motion import STEP_S, Sampled, approach, cut, sample
from plugins.results.workshop.printing import Check
from plugins.results.workshop.stage import PlayedDesign

NEAR_M = 0.005
"""To anything, on a way that is free."""

SLOW = 0.2
"""Of the speed: the first run on the arm."""


def sample_moves(
    cfg: DictConfig, robot: Robot, played: PlayedDesign, contact_s: float | None
) -> dict[str, Sampled]:
    """Return a motion, the ways to its start and back from its end, and it slowly, by the names of their files.

    Args:
        cfg: the settings of the command.
        robot: that moves.
        played: the motion.
        contact_s: when something is touched first, s; up to the last rest before, the motion is sampled slowly, too.
    """
    arm = arm_of(robot)
    motion = played.motion
    start = np.array(list(cfg.start) or robot.home, dtype=np.float64)
    first = motion.positions[0]
    last = motion.positions[-1]
    opening = motion.fingers.tolist()
    moves = {
        "approach": approach(start, first, opening[0], arm, cfg.rate_hz),
        "retreat": approach(last, start, opening[-1], arm, cfg.rate_hz),
        "trajectory": motion,
    }
    if played.dry_run is not None:
        return moves

    def slowly(course: JointTrajectory) -> Sampled:
        return sample(course, arm, cfg.rate_hz, min(SLOW, cfg.speed))

    planned = played.planned
    moves["trajectory_slow"] = slowly(planned.trajectory)
    if contact_s is not None:
        until_s = contact_s / motion.slower - STEP_S
        before = cut(planned.trajectory, planned.arrivals, until_s, arm)
        if before is not None:
            moves["trajectory_before_contact"] = slowly(before)

    return moves


def close_ways(export: Export) -> Export:
    """Leave out the ways that are not free, with a check that says why."""
    steps = len(next(iter(export.replays.values())).recording.times)
    ways = [check_way(export, "approach", 0), check_way(export, "retreat", steps - 1)]
    closed = [way.name for way in ways if not way.passed]
    moves = {name: move for name, move in export.moves.items() if name not in closed}

    return replace(export, moves=moves, checks=[*export.checks, *ways])


def check_way(export: Export, name: str, instant: int) -> Check:
    """Look whether a way is free, of the arm and the tool, where all else stands as it did at an instant.

    Args:
        export: the ways among its motions, and the rollout.
        name: of the way.
        instant: the number of the recording's.
    """
    recording = next(iter(export.replays.values())).recording
    way = export.moves[name]
    samples = way.every(1 / HZ)

    def still(values: Array) -> Array:
        return np.repeat(values[instant : instant + 1], len(samples), axis=0)

    moving = Recording(
        times=way.times[samples],
        arm=way.positions[samples],
        fingers=still(recording.fingers),
        states=recording.states.each(still),
    )
    tool = export.printed.tool
    for row in clearance(export.scene, export.robot, tool, moving):
        least = -DEEP_M if row.to == "itself" else NEAR_M
        if row.metres < least:
            return Check(
                name, None, macros("plugins.results.workshop", "words").near(row)
            )

    return Check(name, True, "free, slow and straight in the joints")
