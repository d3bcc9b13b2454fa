"""Check what a simulator returns: states, recordings, pictures.

Covered by `tests/plugins/simulators/test_conformance.py`.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from core.geometry import Box
from core.interfaces import Image, Simulator
from core.scene import Body, table
from plugins.conformance.checking import expect
from plugins.conformance.worlds import BARE, GREY, Bodies, cube, end, film, start, stick, wait


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
