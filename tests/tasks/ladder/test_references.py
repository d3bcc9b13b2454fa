"""References of the ladder solve what they are drawn with, and simpler designs don't."""

import pytest

from core.config.compose import load, task_part, tool_part
from core.designs.reading import read_designs
from core.search.saved_designs import build_fitness
from core.simulation.play import play
from core.values.efforts import HOLDS
from tasks.ladder.task import FAMILIES
from tests.support.rare import rare


def try_designs(family, level, layouts, engine="mujoco"):
    """Return the rewards of the reference and of the simpler design in drawn layouts."""
    words = [
        *("task=ladder", f"family={family}", f"level={level}", "task.seed=1"),
        *(f"sim={engine}", "tool=boxes", "designs=none", "seed=4000"),
        *("fitness=layouts", f"fitness.layouts={layouts}"),
    ]
    cfg = load("evaluate", words)
    task = task_part(cfg).create()
    designs = [dict(task.proof.reference), dict(task.proof.simpler)]
    pair = read_designs({"strategies": designs}, tool_part(cfg).create(), task)
    conditions = build_fitness(cfg).conditions()
    played = [play(condition, pair) for condition in conditions]
    return [[trials[which].reward for trials in played] for which in (0, 1)]


@pytest.mark.slow
@pytest.mark.parametrize("family", rare(sorted(FAMILIES), "places", "tunnel"))
def test_a_reference_solves_a_layout(family):
    pytest.importorskip("mujoco")
    reference, _ = try_designs(family, 2, 1)
    assert reference == [pytest.approx(1.0, abs=0.02)]


@pytest.mark.thorough
@pytest.mark.parametrize("level", [1, 4, 9])
@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "sapien"])
def test_references_hold_and_simpler_designs_do_not(family, level, engine):
    pytest.importorskip(engine)
    reference, simpler = try_designs(family, level, 10, engine)
    assert sum(reward >= HOLDS for reward in reference) >= 9
    assert sum(reward >= HOLDS for reward in simpler) < 9
