"""Check that an outcome depends on its job alone.

Covered by `tests/plugins/simulators/test_conformance.py`.
"""

from __future__ import annotations

import hashlib

import numpy as np

from core.geometry import Box, Cylinder, Sphere
from core.interfaces import JointTrajectory, Outcome, Rollout, Simulator
from core.scene import Body, table
from plugins.conformance.checking import expect
from plugins.conformance.worlds import BARE, GREY, HAND, Bodies, cube, end, motion, opened, start, stick, still, wait


def _push() -> Rollout:
    return Rollout(stick(0.25), motion([[0.45, 0, 0.3, 0, 0, 0], [0.65, 0, 0.3, 0, 0, 0]]), settle_s=0.1)


def _row() -> Bodies:
    """A stack before the stick, a ball and a can behind it: many contacts."""
    ball = Body.of("ball", Sphere(0.04), (0.7, 0.02, 0.04), mass=0.3, color=GREY, rolling_friction=0.002)
    can = Body.of("can", Cylinder(0.03, 0.1), (0.8, 0.0, 0.05), mass=0.3, color=GREY)
    stack = [cube(f"brick{i}", (0.6, 0.0, 0.03 + 0.06 * i), side=0.06, mass=0.4) for i in range(3)]
    return Bodies(table(), *stack, ball, can)


def bits(outcome: Outcome) -> str:
    """A digest of all numbers of an outcome."""
    numbers = [*start(outcome).arrays, *end(outcome).arrays, np.array([outcome.tracking_error_rad])]
    return hashlib.sha256(np.concatenate([x.ravel() for x in numbers]).tobytes()).hexdigest()


def digest(simulator: Simulator) -> str:
    """A digest of a rollout with many contacts, the same in every process and after any other work."""
    (outcome,) = simulator.rollout(_row(), [_push()])
    moved = np.abs(end(outcome).positions - start(outcome).positions).max()
    expect(moved > 0.05, f"the stick pushed nothing: the bodies moved {moved:.4f} m at most")
    return bits(outcome)


def check_same_job_gives_same_bits(simulator: Simulator) -> None:
    """The same job gives the same bits twice in a row, and after other tools and worlds."""
    first = digest(simulator)
    expect(digest(simulator) == first, "the same job, played twice in a row, gave different numbers")
    wait(simulator, table(), cube(at=(0.5, 0, 0.3)), tool=HAND)
    simulator.rollout(_row(), [Rollout(stick(0.2), _push().trajectory)])
    wait(simulator, Body.of("box", Box((0.1, 0.2, 0.3)), (0.6, 0, 1.0), mass=2.0, color=GREY))
    expect(digest(simulator) == first, "the same job gave different numbers after jobs with other tools and worlds")


def check_batch_gives_what_each_job_alone_gives(simulator: Simulator) -> None:
    """Jobs of one batch do not affect each other."""
    task = _row()
    jobs = [_push(), Rollout(BARE, still(), settle_s=0.1), Rollout(HAND, still(), settle_s=0.1), _push()]
    together = [bits(outcome) for outcome in simulator.rollout(task, jobs)]
    alone = [bits(simulator.rollout(task, [job])[0]) for job in jobs]
    expect(together == alone, "a job in a batch gave other numbers than it gives alone")
    expect(together[0] == together[3], "the same job, twice in a batch, gave different numbers")
    expect(simulator.rollout(task, []) == [], "no jobs must give no outcomes")


def check_broken_job_hurts_no_other(simulator: Simulator) -> None:
    """A job with targets that are not numbers gives an error, and its neighbours stay as they are without it."""
    arms = np.stack([still().arm[0], np.full_like(still().arm[0], np.nan)])
    broken = Rollout(stick(0.25), JointTrajectory(np.array([0.0, 1.0]), arms, opened(2)))
    task = _row()
    before, failed, after = simulator.rollout(task, [_push(), broken, _push()])
    expect(failed.error, "a job whose targets are not numbers must give an outcome with an error")
    expect(failed.start is None and failed.end is None, "an outcome with an error must have no states")
    expect(before.error is None and after.error is None, "a broken job made its neighbours fail")
    expect(bits(before) == bits(after), "a broken job changed what came after it")


def check_pictures_do_not_affect_rollouts(simulator: Simulator) -> None:
    first = digest(simulator)
    simulator.render(_row(), tool=stick(0.25), width=32, height=24)
    expect(digest(simulator) == first, "the same job gave different numbers after a picture was drawn")
