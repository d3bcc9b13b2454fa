"""The body that a rollout turned on: which it is, what touched it last, how it flew, and when its places are told."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from core.config.compose import load, part
from core.designs.reading import load_designs, read_designs
from core.interfaces import RolloutSettings
from core.scene import Body, Box, Scene
from core.simulation.crux import _find_last_touch, choose_body, choose_instants
from core.values.margins import Margin
from core.values.observations import Crux
from tests.support.engines import simulator
from tests.support.playing import evaluate_batch

GALLERY = Path(__file__).parents[3] / "docs" / "gallery" / "model"
CUBE = Box((0.02, 0.02, 0.02))
STATE = Scene(
    tuple(
        Body.of(name, CUBE, (0.1 * n, 0.0, 0.01), mass=0.1, color=(0, 0, 0, 1))
        for n, name in enumerate("abc")
    )
).state()
ERRORS = {"a": (0.01, None, None), "b": (0.02, 0.0, None), "c": (0.3, 0.0, 0.0)}


def least(name):
    return (Margin("off its place", 0.1, 0.2, "m", 0.5, subject=name),)


@pytest.mark.parametrize(
    ("left", "margins", "solved", "chosen"),
    [
        (("a", "b"), least("c"), False, "b"),  # the farthest of those not in place
        (("a",), least("c"), False, "a"),
        ((), least("a"), True, "a"),  # the one with the least room
        (("b",), least("a"), True, "a"),
        ((), (), True, "c"),  # no margin names a body
        ((), (Margin.clearance("b", 0.001),), False, "b"),  # forbidden, all in place
        ((), (Margin.clearance("wall", 0.001),), True, "c"),  # that can't move
    ],
)
def test_the_body_is_that_of_the_largest_miss_or_else_of_the_least_room(
    left, margins, solved, chosen
):
    assert choose_body(left, ERRORS, margins, STATE, solved=solved) == chosen


def test_a_scene_without_goals_and_margins_turns_on_nothing():
    assert choose_body((), {}, (), STATE, solved=False) is None


@pytest.mark.parametrize(
    ("touched", "found"),
    [
        ([], None),
        ([3], (3, 3)),
        ([3, 4, 5], (3, 5)),
        ([3, 7], (3, 7)),  # 0.4 s later it is the same touch
        ([3, 9], (9, 9)),  # 0.6 s later another one
    ],
)
def test_touches_with_a_short_pause_are_one(touched, found):
    times = np.arange(12) / 10
    linked = np.isin(np.arange(12), touched)
    assert _find_last_touch(linked, times) == found


def test_places_are_told_around_the_last_touch():
    crux = Crux("a", (0, 0, 0), (1, 0, 0), touched_s=(2.0, 2.4))
    assert choose_instants(crux, 8.4, 6).tolist() == pytest.approx(
        [0.0, 2.0, 2.2, 2.4, 5.4, 8.4]
    )
    pushed = Crux("a", (0, 0, 0), (1, 0, 0), touched_s=(2.0, 5.6))
    assert choose_instants(pushed, 6.0, 6).tolist() == pytest.approx(
        [0.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    )
    spread = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert choose_instants(None, 5.0, 6).tolist() == pytest.approx(spread)


@cache
def observe(task, engine):
    cfg = load("evaluate", [f"task={task}"])
    made = part("task", cfg.task).create()
    tool = part("tool", cfg.tool).create()
    candidates = read_designs(load_designs(GALLERY / f"{task}.json"), tool, made)
    settings = RolloutSettings(observe=True)
    (found,) = evaluate_batch(made, simulator(engine), candidates, settings=settings)
    return found.observation


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["pybullet", "mujoco", "sapien"])
def test_a_puck_that_is_struck_is_told_by_its_velocity_and_its_nearest_place(engine):
    """It flies past the goal on its right, and still slides at the end."""
    seen = observe("ScoreGoal", engine)
    crux = seen.crux
    assert (crux.body, crux.toucher) == ("puck", "blade")
    first, last = crux.touched_s
    assert last - first < 0.5
    assert seen.instants[1] == pytest.approx(first, abs=0.03)
    assert seen.instants[3] == pytest.approx(last, abs=0.03)
    away = np.subtract(seen.paths["puck"][4], seen.paths["puck"][3])
    way = away[:2] / np.linalg.norm(away)
    assert way @ crux.velocity[:2] / np.linalg.norm(crux.velocity) > 0.98
    assert 0.1 < crux.nearest_m < np.linalg.norm(seen.errors["puck"][:2])
    assert crux.nearest_s > last
    assert crux.speed > 0.5
