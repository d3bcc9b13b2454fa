"""Sample a motion with what leads to it and back, and look whether these ways are free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from omegaconf import DictConfig

from core.geometry import Array
from core.interfaces import Motion, Recording, Robot
from core.robot.kinematics import arm_of
from core.solids.self_collision import DEEP_M
from plugins.results.workshop.clearance import HZ, clearance
from plugins.results.workshop.export import Export
from plugins.results.workshop.motion import STEP_S, Sampled, approach, cut, sample
from plugins.results.workshop.printing import Check

NEAR_M = 0.005
"""To anything, on a way that is free."""

SLOW = 0.2
"""Of the speed: the first run on the arm."""


def sample_moves(cfg: DictConfig, robot: Robot, planned: Motion) -> dict[str, Sampled]:
    """Sample the motion, as it is asked for and slowly, with the ways to its start and back from its end."""
    arm = arm_of(robot)
    motion = sample(planned.trajectory, arm, cfg.rate_hz, cfg.speed)
    start = np.array(list(cfg.start) or robot.home, dtype=np.float64)
    first = motion.positions[0]
    last = motion.positions[-1]
    opening = motion.fingers.tolist()

    return {
        "approach": approach(start, first, opening[0], arm, cfg.rate_hz),
        "retreat": approach(last, start, opening[-1], arm, cfg.rate_hz),
        "trajectory": motion,
        "trajectory_slow": sample(
            planned.trajectory, arm, cfg.rate_hz, min(SLOW, cfg.speed)
        ),
    }


def sample_before(
    cfg: DictConfig, robot: Robot, planned: Motion, contact_s: float
) -> dict[str, Sampled]:
    """Sample the motion slowly up to the last rest before contact.

    Args:
        cfg: the settings of the command.
        robot: that moves.
        planned: the motion as it was simulated.
        contact_s: when something is touched first, s of the planned motion.

    Returns:
        The motion by the name of its file; nothing where the arm does not rest before.
    """
    arm = arm_of(robot)
    before = cut(planned.trajectory, planned.arrivals, contact_s - STEP_S, arm)
    if before is None:
        return {}

    slow = sample(before, arm, cfg.rate_hz, min(SLOW, cfg.speed))

    return {"trajectory_before_contact": slow}


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
            gap_mm = max(0.0, 1000 * row.metres)
            near = f"the {row.what} comes as near as {gap_mm:.0f} mm to {row.to}"
            return Check(name, None, f"{near}: bring the arm by hand, slowly")

    return Check(name, True, "free, slow and straight in the joints")
