"""Check contacts and their forces against formulas, so that engines agree on them.

Forces are looked at where the engine measures them (`Rollout.forces`). Covered by
`tests/plugins/simulators/test_conformance.py`.
"""

from __future__ import annotations

import math

import numpy as np

from core.design import Tool
from core.geometry import Array, Box
from core.interfaces import JointTrajectory, Recording, Rollout, Simulator
from core.scene import Body, Trace, table
from core.solids.contacts import find_contacts, make_trace
from plugins.conformance.checking import expect
from plugins.conformance.worlds import BARE, FAR, GRAVITY, GREY, Bodies, cube, film, motion, run, stick, still

_FALL_M = 0.2
_LATE_S = 0.05  # of the first touch
_SHARE = 0.05  # of a weight that rests
_REACTION = 0.1  # of the force that presses


def _watch(
    simulator: Simulator, *bodies: Body, tool: Tool, trajectory: JointTrajectory, hold_s: float
) -> tuple[Trace, Recording]:
    """Simulate bodies; return the trace and the recording."""
    task = Bodies(*bodies)
    recording = film(run(simulator, bodies, Rollout(tool, trajectory, 0, 0.0, hold_s, 100.0, forces=True)))
    return make_trace(task.scene(0), [find_contacts(task.scene(0), task.robot, tool, recording)])[0], recording


def _steady(recording: Recording, one: str, other: str) -> float:
    """The mean force of two things in the last 0.4 s, N."""
    forces: Array = recording.forces.get((one, other), np.zeros(len(recording.times)))
    return float(forces[recording.times > recording.times[-1] - 0.4].mean())


def check_contact_begins_when_a_body_lands_and_bears_its_weight(simulator: Simulator) -> str | None:
    slab = Body.of("slab", Box((1.0, 1.0, 0.1)), FAR, mass=0.0, color=GREY)
    falls = cube("cube", (FAR[0], FAR[1], FAR[2] + 0.1 + _FALL_M), mass=2.0)
    trace, recording = _watch(simulator, slab, falls, tool=BARE, trajectory=still(), hold_s=2.0)
    lands, first = math.sqrt(2 * _FALL_M / GRAVITY), float(trace.first_s("cube", "slab"))
    what = f"a cube that falls {_FALL_M:g} m first touches the ground after {first:.3f} s"
    expect(abs(first - lands) < _LATE_S, f"{what}; it takes {lands:.3f} s")
    expect(bool(trace.touching_at_end("cube")), "a cube that lies on a slab does not touch it at the end")
    expect(not trace.touched("cube", "robot"), "a cube that lies far from the robot is touched by it")
    if not recording.forces:
        return "it measures no forces"
    weight, force = 2.0 * GRAVITY, _steady(recording, "slab", "cube")
    expect(abs(force / weight - 1) < _SHARE, f"a cube that weighs {weight:.2f} N lies on a slab with {force:.2f} N")
    return None


def check_body_passes_on_what_presses_it(simulator: Simulator) -> str | None:
    plan = [[0.5, 0, 0.45, 0, 0, 0], [0.5, 0, 0.395, 0, 0, 0]]  # 5 mm below the cube's upper side
    bodies = table(), cube(at=(0.5, 0, 0.05))
    trace, recording = _watch(simulator, *bodies, tool=stick(0.3), trajectory=motion(plan), hold_s=1.0)
    expect(bool(trace.touching_at_end("cube", "stick")), "a tool that presses a cube does not touch it at the end")
    expect(not trace.held("cube")[-1], "a cube that stands on the table counts as held by the tool that presses it")
    if not recording.forces:
        return "it measures no forces"
    above, below = _steady(recording, "tool", "cube"), _steady(recording, "table", "cube")
    expect(1 < above < 1000, f"a tool that is driven 5 mm into a cube presses it with {above:.1f} N")
    what = f"a cube that weighs {GRAVITY:.1f} N and is pressed with {above:.1f} N presses the table with {below:.1f} N"
    expect(abs(below - above - GRAVITY) < _REACTION * below, what)
    passed = float(trace.force_n("table", "robot"))
    expect(passed > 0.9 * above, f"of {above:.1f} N on a cube {passed:.1f} N count as what presses the table below it")
    if recording.pushes is None:
        return "it does not tell where forces act"
    late = recording.times[recording.pushes.samples] > recording.times[-1] - 0.4
    pushes, points = recording.pushes.forces[late], recording.pushes.points[late]
    count = np.count_nonzero(recording.times > recording.times[-1] - 0.4)
    up, where = float(pushes[:, 2].sum() / count), points.mean(axis=0)
    expect(
        abs(up - above) < _SHARE * above, f"a tool that presses down with {above:.1f} N is pushed up with {up:.1f} N"
    )
    here = f"a tool that presses the top of a cube at (0.5, 0, 0.1) is pushed at {np.round(where, 3).tolist()}"
    expect(bool(np.abs(where - (0.5, 0.0, 0.1)).max() < 0.02), here)
    return None
