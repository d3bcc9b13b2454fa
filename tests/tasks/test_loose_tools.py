"""Reference tools with round shapes or joints solve their tasks in every engine."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from core.designs.reading import load_designs, read_designs
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.simulation.attempt import prepare
from tasks.bring_cube import SIDE
from tests.support.engines import every_simulator, mujoco_first, simulator
from tests.support.playing import evaluate_batch
from tests.support.rare import rare

SHAPES = Path(__file__).parent / "solutions" / "shapes"
TOOLS = {
    "ladle": ("GatherSpheres", "solids"),
    "tongs": ("BringCube", "boxes"),
    "scraper": ("CleanTable", "boxes"),
}
LIFTED = 11  # waypoints of the tongs' plan until the cube is 3 cm above the table


@cache
def task_of(name):
    return installed().create("task", TOOLS[name][0])


def candidate_of(name):
    representation = installed().create("tool", TOOLS[name][1], joints=True)
    (candidate,) = read_designs(
        load_designs(SHAPES / f"{name}.json"), representation, task_of(name)
    )
    assert candidate.problem is None
    return candidate


def play(name, engine, candidate):
    (evaluation,) = evaluate_batch(task_of(name), simulator(engine), [candidate])
    assert evaluation.status == "ok"
    return evaluation


@mujoco_first
@pytest.mark.parametrize("name", rare(TOOLS, "tongs"))
def test_it_solves_its_task_without_a_penetration(name, engine):
    evaluation = play(name, engine, candidate_of(name))
    assert evaluation.reward >= 0.9
    assert evaluation.warnings == ()


@pytest.mark.slow
@every_simulator
def test_a_scraper_that_is_locked_does_not_follow_the_table(engine):
    assert play("scraper", engine, locked(candidate_of("scraper"))).reward < 0.7


@every_simulator
def test_tongs_lift_the_cube_by_their_springs(engine):
    """Locked ones can't be pressed over it."""
    sprung = candidate_of("tongs")
    heights = []
    for candidate in (sprung, locked(sprung)):
        up = replace(candidate, plan=candidate.plan.poses[:LIFTED])
        _, job = prepare(task_of("tongs"), up, 0, RolloutSettings())
        (outcome,) = simulator(engine).rollout(task_of("tongs"), [job])
        heights.append(outcome.end.position("cube")[2] - SIDE / 2)
    assert heights[0] > 0.02
    assert heights[1] < 0.005


def locked(candidate):
    components = tuple(
        replace(component, joint=None) for component in candidate.tool.components
    )
    return replace(candidate, tool=replace(candidate.tool, components=components))
