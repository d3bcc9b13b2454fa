"""Check what a simulator returns: states, recordings, pictures; and that it depends on the job alone."""

from __future__ import annotations

import hashlib
from functools import partial

import numpy as np

from core.geometry import Box, Cylinder, Sphere
from core.interfaces import Image, JointTrajectory, Outcome, Rollout, Simulator
from core.scene import Body, table
from plugins.conformance.checking import expect
from plugins.conformance.worlds import (
    BARE,
    GREY,
    HAND,
    Bodies,
    cube,
    end,
    film,
    motion,
    opened,
    start,
    stick,
    still,
    wait,
)


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


def check_start_is_after_settling(simulator: Simulator) -> None:
    high = cube(at=(0.6, 0, 0.2))
    height = start(wait(simulator, table(), high, seconds=0.1, settle_s=1.0)).position("cube")[2]
    expect(abs(height - 0.05) < 1e-3, f"a cube that fell while settling starts at {height:.4f} m instead of 0.05 m")
    height = start(wait(simulator, table(), high, seconds=0.1)).position("cube")[2]
    expect(abs(height - 0.2) < 1e-6, f"without settling a cube put at 0.2 m starts at {height:.4f} m")


def check_states_name_the_free_bodies_in_order(simulator: Simulator) -> None:
    post = Body.of("post", Box((0.1, 0.1, 0.1)), (0.6, 0.3, 0.05), mass=0.0, color=GREY)
    state = end(wait(simulator, table(), cube("b", (0.6, 0, 0.05)), post, cube("a", (0.8, 0, 0.05)), seconds=0.1))
    expect(state.names == ("b", "a"), f"the scene's free bodies are b and a, the state's are {state.names}")
    expect(state.positions.shape == (2, 3), f"positions of two bodies have the shape {state.positions.shape}")
    lengths = np.linalg.norm(state.quaternions, axis=-1)
    expect(np.abs(lengths - 1).max() < 1e-5, f"quaternions have the lengths {lengths}")
    empty = end(wait(simulator, table(), seconds=0.1))
    expect(empty.positions.shape == (0, 3), f"positions of no bodies have the shape {empty.positions.shape}")


def check_recordings(simulator: Simulator) -> None:
    """A recording has the requested rate, begins with the settling, and ends with the end state."""
    body = cube(at=(0.6, 0, 0.3))
    for rate in (10, 50):
        outcome = wait(simulator, table(), body, settle_s=0.5, record_hz=rate)
        recording = film(outcome)
        gaps = np.diff(recording.times)
        even = np.abs(gaps - 1 / rate).max() < 0.005
        expect(even, f"at {rate} Hz, instants are {gaps.min()} to {gaps.max()} s apart")
        first, last = recording.times[[0, -1]]
        expect(abs(first + 0.5) < 1e-6, f"a recording with 0.5 s of settling begins at {first} s")
        expect(abs(last - 1.0) < 0.01, f"a recording that holds for 1 s ends at {last} s")
        count = len(recording.times)
        shapes = recording.arm.shape, recording.fingers.shape, recording.states.positions.shape
        expect(shapes == ((count, 7), (count, 2), (count, 1, 3)), f"a recording's arrays have the shapes {shapes}")
        heights = recording.states.position("cube")[:, 2]
        expect(abs(heights[0] - 0.3) < 1e-6, f"a recording begins with a cube at {heights[0]} m that was put at 0.3 m")
        same = np.array_equal(recording.states.positions[-1], end(outcome).positions)
        expect(same, "a recording's last state is not the end state")
    expect(wait(simulator, seconds=0.01).recording is None, "without a rate nothing must be recorded")


def check_pictures(simulator: Simulator) -> None:
    """A picture has the requested size and content, and nothing of earlier pictures."""
    task = Bodies(table(), cube(at=(0.6, 0, 0.05)), name="Pictured")
    draw = partial(simulator.render, task, width=160, height=120)
    plain = draw()
    shape = plain.shape, plain.dtype
    expect(shape == ((120, 160, 3), np.dtype(np.uint8)), f"a picture of 160 by 120 has shape and type {shape}")
    expect(len(np.unique(plain)) > 50, "a picture is blank, or nearly")
    other = simulator.render(task, width=50, height=40)
    expect(other.shape == (40, 50, 3), f"a picture of 50 by 40 has the shape {other.shape}")

    def changed(picture: Image) -> int:
        """Pixels that differ."""
        return int((np.abs(picture.astype(int) - plain).max(axis=-1) > 30).sum())

    moved = task.scene(0).state()
    moved.positions[0] = 0.8, 0.2, 0.05
    expect(20 < changed(draw(state=moved)) < 3000, "a cube that was moved does not show, or the rest changed too")
    expect(changed(draw(state=task.scene(0).state())) == 0, "the state at spawn gives another picture than no state")
    expect(changed(draw(arm=np.array([0.5, 0, 0, -1.5, 0, 1.5, 0.7]))) > 200, "other joints give the same picture")
    expect(changed(draw(fingers=np.zeros(2))) > 0, "closed fingers give the same picture as open ones")
    expect(changed(draw(tool=BARE)) > 20, "the arm without a hand gives the same picture as with it")
    expect(changed(draw(tool=stick(0.4))) > 20, "a tool does not show")
    expect(changed(draw()) == 0, "the first picture, drawn again, is another one")
