"""Check what a simulator returns: states, recordings, pictures; and that it depends on the job alone."""

from __future__ import annotations

import hashlib
from functools import partial
from typing import Any

import numpy as np

from core.geometry import Array, Box, Cylinder, Sphere
from core.interfaces import Image, JointTrajectory, Outcome, Rollout, Simulator
from core.scene import table
from plugins.conformance.scenery import cube, make_body, stick
from plugins.conformance.shared import between, expect, near
from plugins.conformance.worlds import (
    HAND,
    Bodies,
    end,
    film,
    motion,
    opened,
    start,
    still,
    wait,
)


def _push() -> Rollout:
    return Rollout(
        stick(0.25),
        motion([[0.45, 0, 0.3, 0, 0, 0], [0.65, 0, 0.3, 0, 0, 0]]),
        settle_s=0.1,
    )


def _row() -> Bodies:
    """A stack before the stick, a ball and a can behind it: many contacts."""
    ball = make_body(
        "ball", Sphere(0.04), (0.7, 0.02, 0.04), mass=0.3, rolling_friction=0.002
    )
    can = make_body("can", Cylinder(0.03, 0.1), (0.8, 0.0, 0.05), mass=0.3)
    stack = [
        cube(f"brick{i}", (0.6, 0.0, 0.03 + 0.06 * i), side=0.06, mass=0.4)
        for i in range(3)
    ]
    return Bodies(table(), *stack, ball, can)


def bits(outcome: Outcome) -> str:
    """A digest of all numbers of an outcome."""
    numbers = [
        *start(outcome).arrays,
        *end(outcome).arrays,
        np.array([outcome.tracking_error_rad]),
    ]
    return hashlib.sha256(
        np.concatenate([x.ravel() for x in numbers]).tobytes()
    ).hexdigest()


def digest(simulator: Simulator) -> str:
    """A digest of a rollout with many contacts, the same in every process and after any other work."""
    (outcome,) = simulator.rollout(_row(), [_push()])
    moved = np.abs(end(outcome).positions - start(outcome).positions).max()
    between("how far a stick pushes a stack, m", moved, 0.05)
    return bits(outcome)


def check_same_job_gives_same_bits(simulator: Simulator) -> None:
    """The same job gives the same bits twice in a row, and after pictures, other tools and worlds."""
    first = digest(simulator)
    expect(
        digest(simulator) == first,
        "the same job, played twice in a row, gave different numbers",
    )
    wait(simulator, table(), cube(at=(0.5, 0, 0.3)), tool=HAND)
    simulator.render(_row(), tool=stick(0.25), width=32, height=24)
    simulator.rollout(_row(), [Rollout(stick(0.2), _push().trajectory)])
    wait(simulator, make_body("box", Box((0.1, 0.2, 0.3)), (0.6, 0, 1.0), mass=2.0))
    expect(
        digest(simulator) == first,
        "the same job gave different numbers after jobs with other tools and worlds",
    )


def check_batch_gives_what_each_job_alone_gives(simulator: Simulator) -> None:
    """Jobs of one batch do not affect each other, nor does one that breaks: its targets are not numbers."""
    task = _row()
    arms = np.stack([still().arm[0], np.full_like(still().arm[0], np.nan)])
    broken = Rollout(
        stick(0.25), JointTrajectory(np.array([0.0, 1.0]), arms, opened(2))
    )
    jobs = [_push(), Rollout(HAND, still(), settle_s=0.1), broken, _push()]
    outcomes = simulator.rollout(task, jobs)
    expect(
        outcomes[2].error,
        "a job whose targets are not numbers must give an outcome with an error",
    )
    expect(outcomes[2].end is None, "an outcome with an error must have no states")

    for number in (0, 1, 3):
        (alone,) = simulator.rollout(task, [jobs[number]])
        expect(
            bits(alone) == bits(outcomes[number]),
            "a job in a batch gave other numbers than it gives alone",
        )


def check_start_is_after_settling(simulator: Simulator) -> None:
    high = cube(at=(0.6, 0, 0.2))
    for settle_s, due in ((1.0, 0.05), (0.0, 0.2)):
        height = start(
            wait(simulator, table(), high, seconds=0.1, settle_s=settle_s)
        ).position("cube")[2]
        near(
            f"the height at which a cube starts, put at 0.2 m, after {settle_s} s of settling, m",
            height,
            due,
            1e-3,
        )


def check_states_name_the_free_bodies_in_order(simulator: Simulator) -> None:
    post = make_body("post", Box((0.1, 0.1, 0.1)), (0.6, 0.3, 0.05))
    state = end(
        wait(
            simulator,
            table(),
            cube("b", (0.6, 0, 0.05)),
            post,
            cube("a", (0.8, 0, 0.05)),
            seconds=0.1,
        )
    )
    expect(
        state.names == ("b", "a"),
        f"the scene's free bodies are b and a, the state's are {state.names}",
    )
    _expect_shape("positions of two bodies", state.positions, (2, 3))
    near(
        "the lengths of quaternions",
        np.linalg.norm(state.quaternions, axis=-1),
        1.0,
        1e-5,
    )


def _expect_shape(what: str, array: Array | Image, due: tuple[int, ...]) -> None:
    expect(
        array.shape == due,
        f"{what}: an array of the shape {array.shape} instead of {due}",
    )


def check_recordings(simulator: Simulator) -> None:
    """A recording has the requested rate, begins with the settling, and ends with the end state."""
    outcome = wait(
        simulator, table(), cube(at=(0.6, 0, 0.3)), settle_s=0.5, record_hz=50
    )
    recording = film(outcome)
    near("the times between samples at 50 Hz, s", np.diff(recording.times), 0.02, 0.005)
    near(
        "when a recording of 0.5 s of settling begins, and of 1 s ends",
        recording.times[[0, -1]],
        (-0.5, 1),
        0.01,
    )
    near(
        "where a recording begins, m",
        recording.states.position("cube")[0],
        (0.6, 0.0, 0.3),
        1e-6,
    )
    near(
        "where a recording ends, m",
        recording.states.positions[-1],
        end(outcome).positions,
        0.0,
    )
    expect(
        wait(simulator, seconds=0.01).recording is None,
        "without a rate nothing must be recorded",
    )


def check_pictures(simulator: Simulator) -> None:
    """A picture has the requested size and content, and nothing of earlier pictures."""
    task = Bodies(table(), cube(at=(0.6, 0, 0.05)))
    draw = partial(simulator.render, task, width=160, height=120)
    plain = draw()
    _expect_shape("a picture of 160 by 120", plain, (120, 160, 3))
    expect(plain.dtype == np.uint8, f"a picture is of {plain.dtype}, not of uint8")
    moved = task.scene(0).state()
    moved.positions[0] = 0.8, 0.2, 0.05
    changes: dict[str, dict[str, Any]] = {
        "a cube that was moved": {"state": moved},
        "other joints": {"arm": np.array([0.5, 0, 0, -1.5, 0, 1.5, 0.7])},
        "a tool": {"tool": stick(0.4)},
    }
    for what, settings in changes.items():
        off = np.abs(draw(**settings).astype(int) - plain).max(axis=-1)
        between(
            f"how many pixels of a picture change with {what}",
            np.count_nonzero(off > 30),
            20,
        )

    near("a picture that is drawn again", draw(), plain.astype(int), 30)
