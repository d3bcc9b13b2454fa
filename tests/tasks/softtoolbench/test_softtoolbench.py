"""Requirements for every task of SoftToolBench: its reference solution fits layouts that it was not made for, and what
does not do the work earns little.

``cheats/TASK.json`` has five designs that don't, and ``bare.json`` the plan of a bare gripper for each task.
"""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from core.config.compose import load, node
from core.design import Candidate, Tool
from core.designs.reading import load_designs, read_designs
from core.interfaces import Brief, RolloutSettings, Waypoints
from core.plugins import installed
from plugins.fitness.layouts import UNSEEN
from plugins.vlms.offline.answer import answer
from plugins.vlms.offline.search import NothingSuits
from tests.support.engines import simulator
from tests.support.playing import evaluate_batch
from tests.support.rare import rare
from tests.support.solutions import representation

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
ROOT = Path(__file__).parents[3]
OFFERS = installed().offers.items()
TASKS = [
    name
    for (kind, name), offer in OFFERS
    if kind == "task" and offer.entry_point == "softtoolbench"
]
PROTOCOL = node(load("evaluate", ["protocol=varied"]).rollout, RolloutSettings)
BARE = json.loads((HERE / "bare.json").read_text())

every_task = pytest.mark.parametrize("name", TASKS)
# Cloth takes the longest, a rope the least.
quick_tasks = pytest.mark.parametrize(
    "name", rare(TASKS, *[name for name in TASKS if "Cloth" not in name])
)
quickest_task = pytest.mark.parametrize("name", rare(TASKS, "PullRope"))


@cache
def task_of(name):
    return installed().create("task", name, variation="wide")


def designs(file):
    task = task_of(file.stem)
    found = read_designs(load_designs(file), representation(file, "pla"), task)
    assert [candidate.problem for candidate in found] == [None] * len(found)
    return found


def trials(name, candidates, seeds=(0,)):
    """The rewards of designs that are played, with a layout in each row."""
    found = [
        evaluate_batch(task_of(name), simulator("mujoco"), candidates, seed, PROTOCOL)
        for seed in seeds
    ]
    assert not [trial.reason for row in found for trial in row if trial.status != "ok"]
    return np.array([[trial.reward for trial in row] for row in found])


@every_task
def test_names_words_and_configs(name):
    task = task_of(name)
    assert all(
        words.endswith(".") and len(words) > 80
        for words in (task.description, task.in_words)
    )
    assert f"class {name}(Task):" in task.source()
    assert set(task.variations) == {"near", "wide"}
    assert all(
        heading in type(task).__doc__
        for heading in ("Task: ", "Layouts: ", "Success: ")
    )
    assert load("config", [f"task={name}"]).task.name == name
    scenes = [task.scene(seed) for seed in range(3)]
    assert len({scene.bodies[-1].pose.position.tobytes() for scene in scenes}) == 3
    assert all(len(soft.form.nodes) <= 50 for scene in scenes for soft in scene.softs)


@quickest_task
def test_the_embedded_designer_plans_for_it_or_says_that_it_does_not(name):
    parts = installed()
    tools = parts.create("tool", "boxes")
    actions = parts.create("action", "anchored")
    brief = Brief(
        task_of(name),
        0,
        tools,
        False,
        2,
        1,
        generation=0,
        agent=0,
        seed=1,
        actions=actions,
    )
    if name == "SpreadSlab":
        with pytest.raises(NothingSuits, match="SpreadSlab; ask a model"):
            answer(brief)
        return

    assert len(answer(brief)["strategies"]) == 2


@pytest.mark.thorough
@pytest.mark.parametrize("name", TASKS)
def test_the_reference_solution_fits_layouts_that_it_was_not_made_for(name):
    unseen = range(UNSEEN, UNSEEN + 8)
    assert trials(name, designs(HERE / f"{name}.json"), unseen).mean() >= 0.9


@pytest.mark.thorough
@pytest.mark.parametrize("name", TASKS)
def test_doing_nothing_and_the_bare_gripper_earn_little(name):
    home = task_of(name).home
    plan = installed().create("action", "anchored").parse(BARE[name], gripper=True)
    nothing = Candidate(Tool(), Waypoints(np.array([[*home.position, *home.rpy]])))
    assert (
        trials(name, [nothing, Candidate(Tool(gripper=True), plan)], (0, 1, 2)).max()
        < 0.1
    )


@pytest.mark.thorough
@pytest.mark.parametrize("name", TASKS)
def test_cheats_earn_little(name):
    cheats = designs(HERE / "cheats" / f"{name}.json")
    assert len(cheats) == 5
    assert trials(name, cheats).max() < 0.2
