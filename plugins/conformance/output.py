"""Check what a simulator returns: states, recordings, pictures; and that it depends on the job alone."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from core.geometry import Box, Cylinder, Sphere
from core.interfaces import JointTrajectory, Outcome, Rollout, Simulator
from core.scene import table
from plugins.conformance.sample_tools import stick
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import (
    HAND,
    Bodies,
    Film,
    cube,
    make_body,
    motion,
    opened,
    still,
    watch,
)


def _push() -> Rollout:
    way = motion([[0.45, 0, 0.3, 0, 0, 0], [0.65, 0, 0.3, 0, 0, 0]])
    return Rollout(stick(0.25), way, settle_s=0.1)


def _row() -> Bodies:
    """A stack before the stick, a ball and a can behind it: many contacts."""
    round_one = make_body("ball", Sphere(0.04), (0.7, 0.02, 0.04), 0.3)
    ball = replace(round_one, rolling_friction=0.002)
    can = make_body("can", Cylinder(0.03, 0.1), (0.8, 0.0, 0.05), 0.3)
    stack = []
    for number in range(3):
        at = (0.6, 0.0, 0.03 + 0.06 * number)
        stack.append(cube(f"brick{number}", at, side=0.06, mass=0.4))

    return Bodies(table(), *stack, ball, can)


def bits(outcome: Outcome) -> str:
    """A digest of all numbers of an outcome."""
    assert outcome.start is not None
    assert outcome.end is not None
    numbers = [*outcome.start.arrays, *outcome.end.arrays]
    flat = [array.ravel() for array in numbers]
    flat.append(np.array([outcome.tracking_error_rad]))
    return hashlib.sha256(np.concatenate(flat).tobytes()).hexdigest()


def digest(simulator: Simulator) -> str:
    """A digest of a rollout with many contacts, the same in every process and after any other work."""
    (outcome,) = simulator.rollout(_row(), [_push()])
    played = Film(_row().scene(0), outcome)
    moved = np.abs(played.end.positions - played.start.positions).max()
    between("how far a stick pushes a stack, m", moved, 0.05)
    return bits(outcome)


def check_same_job_gives_same_bits(simulator: Simulator) -> None:
    """The same job gives the same bits twice in a row, and after pictures, other tools and worlds."""
    first = digest(simulator)
    again = digest(simulator)
    assert again == first, "the same job, played twice in a row, gave different numbers"

    watch(simulator, table(), cube(at=(0.5, 0, 0.3)), tool=HAND)
    simulator.render(_row(), tool=stick(0.25), width=32, height=24)
    simulator.rollout(_row(), [Rollout(stick(0.2), _push().trajectory)])
    watch(simulator, make_body("box", Box((0.1, 0.2, 0.3)), (0.6, 0, 1.0), 2.0))
    later = digest(simulator)
    assert later == first, (
        "the same job gave different numbers after jobs with other tools and worlds"
    )


def check_batch_gives_what_each_job_alone_gives(simulator: Simulator) -> None:
    """Jobs of one batch do not affect each other, nor does one that breaks: its targets are not numbers."""
    task = _row()
    arms = np.stack([still().arm[0], np.full_like(still().arm[0], np.nan)])
    lost = JointTrajectory(np.array([0.0, 1.0]), arms, opened(2))
    waiting = Rollout(HAND, still(), settle_s=0.1)
    jobs = [_push(), waiting, Rollout(stick(0.25), lost), _push()]
    outcomes = simulator.rollout(task, jobs)
    broken = outcomes[2]
    assert broken.error, (
        "a job whose targets are not numbers must give an outcome with an error"
    )
    assert broken.end is None, "an outcome with an error must have no states"

    for number in (0, 1, 3):
        (alone,) = simulator.rollout(task, [jobs[number]])
        assert bits(alone) == bits(outcomes[number]), (
            "a job in a batch gave other numbers than it gives alone"
        )


def check_start_is_after_settling(simulator: Simulator) -> None:
    for settle_s, due in ((1.0, 0.05), (0.0, 0.2)):
        high = cube(at=(0.6, 0, 0.2))
        played = watch(simulator, table(), high, settle_s=settle_s, hold_s=0.1)
        near(
            f"the height at which a cube starts, put at 0.2 m, after {settle_s} s of settling, m",
            played.start.position("cube")[2],
            due,
            1e-3,
        )


def check_states_name_the_free_bodies_in_order(simulator: Simulator) -> None:
    post = make_body("post", Box((0.1, 0.1, 0.1)), (0.6, 0.3, 0.05))
    cubes = [cube("b", (0.6, 0, 0.05)), post, cube("a", (0.8, 0, 0.05))]
    state = watch(simulator, table(), *cubes, hold_s=0.1).end
    assert state.names == ("b", "a"), (
        f"the scene's free bodies are b and a, the state's are {state.names}"
    )
    assert state.positions.shape == (2, 3), f"positions are {state.positions.shape}"
    lengths = np.linalg.norm(state.quaternions, axis=-1)
    near("the lengths of quaternions", lengths, 1.0, 1e-5)


def check_recordings(simulator: Simulator) -> None:
    """A recording has the requested rate, begins with the settling, and ends with the end state."""
    bodies = (table(), cube(at=(0.6, 0, 0.3)))
    played = watch(simulator, *bodies, settle_s=0.5, record_hz=50)
    times = played.times
    near("the times between samples at 50 Hz, s", np.diff(times), 0.02, 0.005)
    near(
        "when a recording of 0.5 s of settling begins, and of 1 s ends",
        times[[0, -1]],
        (-0.5, 1),
        0.01,
    )
    path = played.path("cube")
    near("where a recording begins, m", path[0], (0.6, 0.0, 0.3), 1e-6)
    near("where a recording ends, m", path[-1], played.end.position("cube"), 0.0)
    unrecorded = watch(simulator, hold_s=0.01, record_hz=0.0).outcome
    assert unrecorded.recording is None, "without a rate nothing must be recorded"


def check_pictures(simulator: Simulator) -> None:
    """A picture has the requested size and content, and nothing of earlier pictures."""
    task = Bodies(table(), cube(at=(0.6, 0, 0.05)))
    draw = partial(simulator.render, task, width=160, height=120)
    plain = draw()
    form = (*plain.shape, str(plain.dtype))
    assert form == (120, 160, 3, "uint8"), (
        f"a picture of 160 by 120 is {form}, not (120, 160, 3) of uint8"
    )

    moved = task.scene(0).state()
    moved.positions[0] = 0.8, 0.2, 0.05
    changes: dict[str, dict[str, Any]] = {
        "a cube that was moved": {"state": moved},
        "other joints": {"arm": np.array([0.5, 0, 0, -1.5, 0, 1.5, 0.7])},
        "a tool": {"tool": stick(0.4)},
    }
    for change, settings in changes.items():
        off = np.abs(draw(**settings).astype(int) - plain).max(axis=-1)
        between(
            f"how many pixels of a picture change with {change}",
            np.count_nonzero(off > 30),
            20,
        )

    near("a picture that is drawn again", draw(), plain.astype(int), 30)
