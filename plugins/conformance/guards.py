"""Check motions with guards, in an engine that plays them: where a guard ends, and what comes after."""

from __future__ import annotations

import numpy as np

from core.design import Candidate
from core.designs.planning import named_actions, parse_plan
from core.geometry import Array, Box
from core.interfaces import Feel, JsonObject, Outcome, RolloutSettings, Simulator
from core.scene import Body
from core.simulation.attempt import prepare
from core.values.jobs import FEEL_S
from plugins.conformance.scenery import cube, make_body, stick
from plugins.conformance.shared import expect, near
from plugins.conformance.worlds import Bodies, arm, film, play

_STICK = 0.2  # m
_TOP = 0.1  # m: of the block
_FROM = 0.35  # m: the height from which it is touched
_SPEED = 0.05  # m/s
_STOP_M = 0.003  # within so much of the wall a touch ends: the way in two readings, and what the contact yields
_STRONG_N = 40.0  # friction holds the cube with 5 N


def _played(simulator: Simulator, steps: list[JsonObject], *bodies: Body) -> Outcome:
    """Play a plan with guards.

    Args:
        simulator: plays it.
        steps: the waypoints, as ``action=anchored`` has them; in the world, so that they are the same wherever a guard
            ends.
        bodies: of the scene.

    Raises:
        LeftOut: the engine plays no motions with guards.
        AssertionError: the rollout broke.
    """
    task = Bodies(*bodies)
    settings = RolloutSettings(settle_s=0.1, hold_s=0.3, feel=Feel(noise=0.05))
    actions = named_actions({"action": "anchored"})
    plan = parse_plan(actions, steps, gripper=False)
    candidate = Candidate(stick(_STICK), plan)
    _, job = prepare(task, candidate, 0, settings, 1 / FEEL_S)

    return play(simulator, task, job)


def _mount(outcome: Outcome, at_s: float) -> Array:
    """Return where the mount was at an instant, (3,) m.

    Args:
        outcome: of a motion that was recorded.
        at_s: seconds from the start of the motion; beyond its end the last instant counts.
    """
    recording = film(outcome)
    instant = int(np.searchsorted(recording.times[:-1], at_s - 1e-6))
    place: Array = arm().positions(recording.arm[[instant]])[0]

    return place


def check_that_touch_ends_at_a_wall(simulator: Simulator) -> None:
    """Two guards in a row: down until touched, up, and down again; each ends where the block begins.

    After the last one the arm rests there too, since no waypoint follows.
    """
    block = make_body("block", Box((0.2, 0.2, _TOP)), (0.55, 0.0, _TOP / 2))

    high = {"offset": [0.55, 0.0, _FROM]}
    low = {"offset": [0.55, 0.0, _STICK + _TOP / 2], "speed": _SPEED, "until": "touch"}
    outcome = _played(simulator, [high, low, high, low], block)
    _expect_fired(outcome, "touch", "touch")
    instants = [felt.at_s for felt in outcome.felt]
    ends = [_mount(outcome, at_s)[2] for at_s in (*instants, np.inf)]
    near(
        "where two touches of a block end, and the arm rests, m",
        ends,
        _STICK + _TOP,
        _STOP_M,
    )


def check_that_force_ends_a_push(simulator: Simulator) -> None:
    """A cube of 1 kg slides with less than the guard asks for, until a wall holds it.

    So the push ends where the cube, which is 0.1 m wide, is between the stick and the wall.
    """
    floor = make_body("floor", Box((2.0, 2.0, 0.1)), (0.5, 0.0, -0.05))
    pushed = cube("cube", (0.55, 0.0, 0.05), mass=1.0)
    wall = make_body("wall", Box((0.05, 0.6, 0.2)), (0.75, 0.0, 0.1))

    before = {"offset": [0.42, 0.0, _STICK + 0.03]}
    push = {
        "offset": [0.72, 0.0, _STICK + 0.03],
        "speed": _SPEED,
        "until": "force",
        "newtons": _STRONG_N,
    }
    outcome = _played(simulator, [before, push], pushed, wall, floor)
    _expect_fired(outcome, "force")
    ended = _mount(outcome, outcome.felt[0].at_s)[0]
    near(f"where a push of a cube to {_STRONG_N} N ends, x in m", ended, 0.615, 0.005)


def _expect_fired(outcome: Outcome, *due: str) -> None:
    """Check which guards ended the motion's ways, in order.

    Raises:
        AssertionError: others did, or none.
    """
    fired = tuple(felt.fired for felt in outcome.felt)
    expect(fired == due, f"what guards fired: {fired} instead of {due}")
