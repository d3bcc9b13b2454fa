"""The ways of using a rigid tool: for which bodies and goals each is, and what it earns in MuJoCo."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from core.interfaces import PAPER, Task
from core.plugins import installed
from plugins.vlms.offline.answer import answer
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.making import make
from plugins.vlms.offline.options import list_options
from plugins.vlms.offline.recipe import Mount, Recipe
from plugins.vlms.offline.search import Search
from plugins.vlms.offline.ways import WAYS
from tests.plugins.vlms.offline.trying import earn, list_ways, make_brief, read_task
from tests.support.errands import CUBE, NEARER, TURNED
from tests.support.panda import on_panda

CARDS = "\n" + "".join(
    f"  - {{name: card_{x}_{y}, box: [0.03, 0.03, 0.03], position: [0.{x}, {y / 10}, 0.015], mass: 0.01}}\n"
    for x in (5, 6, 7)
    for y in (-1, 1)
)
TUNNEL = f"""{CUBE}
  - {{name: roof, box: [0.6, 0.2, 0.02], position: [0.8, 0, 0.11], fixed: true}}
"""
# Its edge is 1 cm before the cube's side, and 1 cm behind it.
SHELF = """
  - {{name: shelf, box: [0.6, 0.2, 0.02], position: [{}, 0, {}], fixed: true}}
"""
OVERHUNG = CUBE + SHELF.format(0.92, 0.27)
BESIDE_SHELF = CUBE + SHELF.format(0.94, 0.27)
UNDER_A_ROOF = CUBE + SHELF.format(0.8, 0.67)
BESIDE_STAND = f"""{CUBE}
  - {{name: stand, box: [0.1, 0.1, 0.1], position: [0.5, 0.3, 0.05], fixed: true}}
"""
WALLED = f"""{CUBE}
  - {{name: wall, box: [0.02, 0.5, 0.2], position: [0.5, 0, 0.1], fixed: true}}
"""
ON_STAND = """
  - {bodies: [cube], at: stand, place: [0, 0, 0.08], tolerance: 0.02, released: true}
"""
IN_THE_AIR = """
  - {bodies: [cube], at: stand, place: [0, 0, 0.2], tolerance: 0.02, released: true}
"""
IN_HAND = """
  - {bodies: [cube], place: [0.4, 0, null], tolerance: 0.02, held: true}
"""
UP = """
  - {bodies: ["*"], raised: 0.15}
"""
FAR = """
  - {bodies: ["*"], place: [2.0, 0, null], tolerance: 0.1}
"""
MOUNT = Mount(0.3, 0.0, -0.2, 0.0, "elbow")
WEDGED = """
  - {name: card, box: [0.06, 0.003, 0.06], position: [0.6, 0, 0.03], mass: 0.02}
  - {name: left, box: [0.4, 0.02, 0.03], position: [0.6, 0.0122, 0.015], fixed: true}
  - {name: right, box: [0.4, 0.02, 0.03], position: [0.6, -0.0122, 0.015], fixed: true}
"""
OVER_BASE = """
  - {name: cube, box: [0.06, 0.06, 0.06], position: [0, 0, 1], mass: 0.2}
gravity: [0, 0, 0]
"""
TWO = """
  - {name: left, box: [0.04, 0.04, 0.04], position: [0.6, 0.03, 0.02], mass: 0.1}
  - {name: right, box: [0.04, 0.04, 0.04], position: [0.6, -0.03, 0.02], mass: 0.1}
  - {name: plate, box: [0.02, 0.02, 0.001], position: [0.6, 0, 0.0005], fixed: true}
"""
OVER_PLATE = """
  - {bodies: [left, right], at: plate, place: [0, 0, 0.3], tolerance: 0.2}
"""


@pytest.mark.parametrize(
    ("bodies", "goals", "ways"),
    [
        (CUBE, NEARER, {"push", "cage", "hook"}),
        (CARDS, NEARER, {"push", "sweep"}),
        (TUNNEL, NEARER, {"hook"}),
        (OVERHUNG, NEARER, {"hook"}),
        (BESIDE_SHELF, NEARER, {"push", "cage", "hook"}),
        (UNDER_A_ROOF, NEARER, {"hook"}),
        (WALLED, NEARER, {"scoop"}),
        (CUBE, UP, {"scoop"}),
        (CUBE, FAR, {"throw"}),
        (CUBE, TURNED, set()),
        (CUBE, IN_HAND, set()),
        (BESIDE_STAND, ON_STAND, set()),
    ],
)
def test_ways_are_for_bodies_and_goals(tmp_path, bodies, goals, ways):
    task = read_task(tmp_path, bodies, goals)
    assert list_ways(make_brief(task)) == ways


@pytest.mark.parametrize(
    ("bodies", "goals", "ways"),
    [
        (BESIDE_STAND, ON_STAND, {"grip"}),
        (BESIDE_STAND, IN_THE_AIR, set()),
        (CUBE, IN_HAND, {"grip"}),
    ],
)
def test_fingers_are_for_what_ends_in_them_or_on_something(
    tmp_path, bodies, goals, ways
):
    task = read_task(tmp_path, bodies, goals)
    assert list_ways(make_brief(task, gripper=True)) == ways


@pytest.mark.slow
def test_fingers_let_go_of_what_they_stack(tmp_path):
    task = read_task(tmp_path, BESIDE_STAND, ON_STAND)
    assert max(earn(make_brief(task, gripper=True), "grip", 6)) > 0.9


@pytest.mark.parametrize("bodies", [CUBE, WALLED, CARDS, TUNNEL])
def test_values_that_leave_their_ranges_still_make_a_design(tmp_path, bodies):
    """Mutations go half a range beyond both ends, where a side can come out less than nothing."""
    goals = UP if bodies == WALLED else NEARER
    search = Search(make_brief(read_task(tmp_path, bodies, goals)))

    for option in search.options:
        ranges = option.way.ranges
        mount = None if option.way.bolted else MOUNT
        middle = {name: (low + high) / 2 for name, (low, high) in ranges.items()}
        for name, (low, high) in ranges.items():
            beyond = (high - low) / 2
            for value in (low - beyond, high + beyond):
                made = make(option, Recipe({**middle, name: value}, mount))
                assert np.isfinite(made.rows).all()


def test_heads_read_their_own_parameters_alone():
    """All plans of a tool have one head, whatever the parameters of their motions are."""
    seen = set()
    for name in ("BringCube", "ElevatePlate", "HighObject", "ScoreGoal", "TurkeyLegs"):
        for gripper in (False, True):
            brief = make_brief(task_of(name), gripper)
            for option in list_options(
                Layout(brief.task, 0, PAPER), brief.task, gripper, None
            ):
                sizes = {key: low for key, (low, _) in option.way.sizes.items()}
                assert option.way.head(option.jobs[0], sizes).pieces
                seen.add(option.way.name)

    assert seen >= {"push", "cage", "hook", "throw", "drop", "lift", "scoop", "pour"}


@pytest.mark.parametrize(
    ("bodies", "goals", "gripper"),
    [
        (WEDGED, NEARER, False),  # no wall is as narrow as the room beside the card
        (OVER_BASE, NEARER, True),  # nothing there is away from the robot
        (TWO, OVER_PLATE, False),  # on the level they are where they have to be
    ],
)
def test_odd_places_are_answered(tmp_path, bodies, goals, gripper):
    brief = make_brief(read_task(tmp_path, bodies, goals), gripper=gripper)
    actions = installed().create("action", "anchored")
    with warnings.catch_warnings(action="error"):
        (design,) = answer(replace(brief, actions=actions))["strategies"]
    assert design["action_sets"]


def task_of(name: str) -> Task:
    """Make a task of the benchmark."""
    task: Task = on_panda(installed().create("task", name))
    return task


@pytest.mark.parametrize(
    ("name", "way", "least"),
    [
        ("BringCube", "push", 0.9),
        ("BringCube", "cage", 0.9),
        ("CleanTable", "sweep", 0.7),
        ("DislodgeCube", "hook", 0.9),
        ("ElevatePlate", "lift", 0.9),
        ("HighObject", "drop", 0.9),
    ],
)
@pytest.mark.slow
def test_a_way_does_what_it_is_for(name, way, least):
    rewards = earn(make_brief(task_of(name)), way, 8)
    assert max(rewards) > least


@pytest.mark.slow
def test_scoops_lift_what_lies_between_walls():
    assert max(earn(make_brief(task_of("GatherSpheres")), "scoop", 3)) > 0.8


def test_each_way_says_what_it_is():
    names = [way.name for way in WAYS]
    assert len(set(names)) == len(names)
    for way in WAYS:
        assert not {*way.sizes} & {*way.moves}
        assert all(
            low < high for low, high in (*way.sizes.values(), *way.moves.values())
        )


def test_what_lies_in_a_body_goes_along_and_bars_nothing(tmp_path):
    ball = "\n  - {name: ball, sphere: 0.01, mass: 0.02, position: [0.6, 0, 0.03]}\n"
    tray = """
  - name: tray
    mass: 0.3
    position: [0.6, 0, 0]
    parts:
      - {box: [0.1, 0.1, 0.01], position: [0, 0, 0.005]}
      - {box: [0.01, 0.1, 0.04], position: [0.05, 0, 0.02]}
      - {box: [0.01, 0.1, 0.04], position: [-0.05, 0, 0.02]}"""
    goal = "\n  - {bodies: [tray], place: [0.5, 0, null]}\n"
    alone = list_ways(make_brief(read_task(tmp_path, tray + "\n", goal)))
    loaded = list_ways(make_brief(read_task(tmp_path, tray + ball, goal)))
    assert loaded == alone != set()
