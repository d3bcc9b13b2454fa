import numpy as np
import pytest

from core.design import DesignError
from core.designs.plan_rules import find_turn_warnings
from core.designs.planning import look, resolve
from core.errors import UsageError
from core.interfaces import ActionPlan, Perception, RolloutSettings, Tempo, Waypoints
from tasks.bring_cube import BringCube
from tests.support.panda import on_panda
from tests.support.refusing import refused

TASK = on_panda(BringCube())
POSES = np.array([[0.5, 0.0, 0.4, 0.0, 0.0, 0.0]])


class Plan(ActionPlan):
    """A plan that means what it was given, whatever that is."""

    action = "mine"

    def __init__(self, meant):
        self.meant = meant

    def resolve(self, seen):
        if isinstance(self.meant, Exception):
            raise self.meant
        return self.meant(seen) if callable(self.meant) else self.meant

    def dump(self):
        return []


def test_all_bodies_and_marks_are_seen_where_they_are():
    seen = look(TASK, 0, Perception())
    scene = TASK.scene(0)
    assert set(seen.poses) == {body.name for body in scene.bodies}
    for body in scene.bodies:
        np.testing.assert_array_equal(seen.poses[body.name].matrix, body.pose.matrix)


def test_noise_is_as_large_as_asked_and_repeats():
    draws = []
    for seed in range(300):
        seen, exact = (
            look(TASK, seed, noise).poses["cube"]
            for noise in (Perception(0.005, 0.05), Perception())
        )
        yaw = (exact.rotation.inv() * seen.rotation).as_rotvec()[2]
        draws.append([*(seen.position - exact.position), yaw])
    spread = np.std(draws, axis=0)
    np.testing.assert_allclose(spread, [0.005, 0.005, 0.0, 0.05], rtol=0.15)
    again = look(TASK, 7, Perception(0.005, 0.05)).poses["cube"]
    np.testing.assert_array_equal(
        again.position, look(TASK, 7, Perception(0.005, 0.05)).poses["cube"].position
    )


@pytest.mark.parametrize(
    "wrong", [{"position": -0.1}, {"yaw": 2.0}, {"position": float("nan")}]
)
def test_noise_that_cannot_be(wrong):
    with pytest.raises(
        UsageError,
        match=f"rollout.perception.{next(iter(wrong))} must be between 0 and 1",
    ):
        Perception(**wrong)


def test_a_plan_is_resolved_against_what_is_seen():
    plan = Plan(
        lambda seen: Waypoints(
            POSES + np.array([*seen.poses["cube"].position, 0, 0, 0]) * 0.1
        )
    )
    assert resolve(plan, TASK, 0, RolloutSettings()).poses[0, 0] > 0.5
    literal = Waypoints(POSES)
    assert resolve(literal, TASK, 0, RolloutSettings()) is literal


@pytest.mark.parametrize(
    ("meant", "problem"),
    [
        (DesignError("no anchor"), "no anchor"),
        (RuntimeError("oops"), r"resolve raised RuntimeError: oops"),
        (POSES, r"resolve gave 'array.*; expected Waypoints"),
        (Waypoints(POSES * 10), r"waypoint 1: x is 5.0; it must be between -3 and 3"),
        (Waypoints(POSES * np.nan), r"waypoint 1: x is nan"),
        (Waypoints(np.empty((0, 6))), r"has 0 waypoints"),
    ],
)
def test_a_plan_that_means_nothing_here_is_a_design_error(meant, problem):
    with pytest.raises(DesignError, match=problem):
        resolve(Plan(meant), TASK, 0, RolloutSettings())


def paced(**given):
    tempo = {
        "seconds": np.full(2, np.nan),
        "speeds": np.full(2, np.nan),
        "waits": np.zeros(2),
    }
    return Waypoints(
        np.vstack([POSES, POSES]), Tempo(through=np.zeros(2, bool), **tempo | given)
    )


@pytest.mark.parametrize(
    ("given", "code", "values"),
    [
        (
            {"speeds": np.array([np.nan, 1e-6])},
            "E_TEMPO",
            {"waypoint": 2, "name": "speed", "given": 1e-6, "least": 0.001},
        ),
        (
            {"seconds": np.array([5e-324, np.nan])},
            "E_TEMPO",
            {"waypoint": 1, "name": "time"},
        ),
        (
            {"seconds": np.array([60.0, 61.0])},
            "E_PLAN_TIME",
            {"time_s": 121.0, "most_s": 120},
        ),
        ({"waits": np.array([60.0, 61.0])}, "E_PLAN_TIME", {"time_s": 121.0}),
        (
            {"speeds": np.array([0.001, np.nan]), "waits": np.array([21.0, 0.0])},
            "E_PLAN_TIME",
            {"time_s": 121.0},
        ),
    ],
)
def test_a_tempo_that_costs_too_much_is_refused_before_it_is_planned(
    given, code, values
):
    with refused(code, **values):
        resolve(paced(**given), TASK, 0, RolloutSettings())


@pytest.mark.parametrize(
    ("yaws", "said"),
    [
        ([0, 5.0, 5.0], "waypoint 2: its yaw of 5 is read as radians, a turn of 286"),
        ([1, 5.0, 5.0], "waypoint 2: its yaw of 5 is read as radians, a turn of 229"),
        ([5.0], "if 5 degrees were meant, write 0.08727"),
        ([0, 1.57, -1.57], None),
        ([3.1, -3.1], None),  # across the end of the range
        ([0, 2.0, 4.0, 6.0], None),  # step by step
    ],
)
def test_a_turn_of_more_than_half_has_warned_with_both_readings(yaws, said):
    found = list(find_turn_warnings(np.array([[0.0, 0.0, yaw] for yaw in yaws])))
    assert len(found) == (said is not None)
    assert not found or said in found[0]
