"""Check motions with guards, in an engine that plays them: where a guard ends, and what comes after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.geometry import Array, Box
from core.interfaces import Feel, Guard, Outcome, RolloutSettings, Simulator, Tempo, Waypoints
from core.robot.tempo import plan_task_motion
from core.scene import Body
from core.simulation.guards import PlannedGuards
from core.values.jobs import FEEL_S, Rollout
from plugins.conformance.checking import LeftOut, expect
from plugins.conformance.worlds import GREY, HOME, Bodies, arm, cube, film, play, stick

_STICK, _TOP, _FROM, _SPEED = 0.2, 0.1, 0.35, 0.05  # metres, and m/s
_STOP_M = 0.003  # within so much of the wall a touch ends: the way in two readings, and what the contact yields
_WEAK_N, _STRONG_N = 8.0, 40.0  # friction holds 1 kg with 5 N, and 4 kg with 20 N


class _Home(Bodies):
    home = HOME


def _played(
    simulator: Simulator, rows: Array, guards: tuple[Guard | None, ...], *bodies: Body
) -> tuple[Outcome, PlannedGuards]:
    """Play waypoints (N, 6), each approached slowly, with guards; literal ones are the same wherever a guard ends."""
    if not simulator.feels:
        raise LeftOut("it plays no motions with guards")
    count, task, settings = len(rows), _Home(*bodies), RolloutSettings(feel=Feel(noise=0.05))
    tempo = replace(Tempo.usual(count), speeds=np.where([guard is None for guard in guards], np.nan, _SPEED))
    plan = Waypoints(rows, tempo, guards)
    motion = plan_task_motion(plan, task, settings)
    playing = PlannedGuards(plan, plan, motion, task, 0, settings)
    job = Rollout(stick(_STICK), motion.trajectory, 0, 0.1, 0.3, 1 / FEEL_S, guards=playing)
    return play(simulator, task, job), playing


def _rows(*places: tuple[float, float, float]) -> Array:
    return np.array([[*place, 0.0, 0.0, 0.0] for place in places])


def _mount(outcome: Outcome, at_s: float) -> Array:
    """Where the mount was at an instant."""
    recording = film(outcome)
    place: Array = arm().positions(recording.arm[[int(np.searchsorted(recording.times[:-1], at_s - 1e-6))]])[0]
    return place


def check_that_touch_ends_at_a_wall(simulator: Simulator) -> str:
    """Two guards in a row: down until touched, up, and down again; each ends where the block begins."""
    block = Body.of("block", Box((0.2, 0.2, _TOP)), (0.55, 0.0, _TOP / 2), mass=0.0, color=GREY)
    high, low = (0.55, 0.0, _FROM), (0.55, 0.0, _STICK + _TOP / 2)
    touch = Guard("touch")
    outcome, playing = _played(simulator, _rows(high, low, high, low), (None, touch, None, touch), block)
    expect(
        [felt.fired for felt in outcome.felt] == ["touch", "touch"],
        f"two touches of a block were expected, and felt was: {'; '.join(map(str, outcome.felt)) or 'nothing'}",
    )
    missed = [float(_mount(outcome, felt.at_s)[2]) - _STICK - _TOP for felt in outcome.felt]
    expect(
        max(map(abs, missed)) < _STOP_M,
        f"a touch ended {1000 * max(missed, key=abs):.1f} mm from the block; at most {1000 * _STOP_M:g} mm are allowed",
    )
    end = float(_mount(outcome, np.inf)[2]) - _STICK - _TOP
    expect(abs(end) < _STOP_M, f"after a touch the arm rests {1000 * end:.1f} mm from the block")
    expect(
        np.allclose(playing.motion.trajectory.arm[-1], film(outcome).arm[-1], atol=0.01),
        "the motion that came back is not the one that was played",
    )
    return f"{1000 * max(map(abs, missed)):.2f} mm from the block"


def check_that_force_ends_a_push(simulator: Simulator) -> str:
    """A cube of 1 kg slides with less than the guard asks for, until a wall holds it; one of 4 kg is felt at once."""
    floor = Body.of("floor", Box((2.0, 2.0, 0.1)), (0.5, 0.0, -0.05), mass=0.0, color=GREY)
    pushed = cube("cube", (0.55, 0.0, 0.05), mass=1.0)
    wall = Body.of("wall", Box((0.05, 0.6, 0.2)), (0.75, 0.0, 0.1), mass=0.0, color=GREY)
    rows = _rows((0.42, 0.0, _STICK + 0.03), (0.72, 0.0, _STICK + 0.03))
    weak, _ = _played(simulator, rows, (None, Guard("force", newtons=_WEAK_N)), replace(pushed, mass=4.0), floor)
    outcome, _ = _played(simulator, rows, (None, Guard("force", newtons=_STRONG_N)), pushed, wall, floor)
    expect(weak.felt[0].fired == "force", f"pushing 4 kg takes 20 N, and {_WEAK_N:g} N were not felt")
    expect(outcome.felt[0].fired == "force", f"a cube was pushed against a wall, and {_STRONG_N:g} N were not felt")
    begin, end = (float(_mount(of, of.felt[0].at_s)[0]) + 0.01 for of in (weak, outcome))
    expect(abs(begin - 0.5) < 0.005, f"the push of the heavy cube ended at x = {begin:.3f} m; it stands at 0.500 m")
    expect(abs(end - 0.625) < 0.005, f"the push to the wall ended at x = {end:.3f} m; the cube is there at 0.625 m")
    return f"{1000 * abs(begin - 0.5):.1f} and {1000 * abs(end - 0.625):.1f} mm from where it was expected"


def check_that_a_guard_may_never_fire(simulator: Simulator) -> None:
    """What follows is as asked: the motion goes on as planned, or ends at the guard's waypoint."""
    rows = _rows((0.5, 0.1, 0.4), (0.5, -0.1, 0.4))
    for otherwise, last in (("go_on", rows[1]), ("end", rows[0])):
        guard = Guard("touch", otherwise="end" if otherwise == "end" else "go_on")
        outcome, playing = _played(simulator, rows, (guard, None), cube(at=(0.5, 0.6, 0.05)))
        expect([felt.fired for felt in outcome.felt] == [""], f"nothing is there, and felt was {outcome.felt[0]}")
        end = _mount(outcome, np.inf)
        expect(np.allclose(end, last[:3], atol=0.003), f"otherwise={otherwise}: the motion ended at {np.round(end, 3)}")
        expect(len(playing.motion.arrivals) == (2 if otherwise == "go_on" else 1), "the arrivals don't fit the motion")
