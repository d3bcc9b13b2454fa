"""Rewards over layouts, and what the search never sees."""

import json
import pickle
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.design import Component, Tool
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import Condition, Perception
from core.plugins import PluginPart
from core.search.orchestration import resume, run
from core.simulation.play import play
from plugins.fitness.layouts import UNSEEN, worst_quarter
from plugins.fitness.nominal import Nominal
from plugins.results.pages.runs import read_run
from plugins.vlms.context.feedback import combined_figures
from tests.plugins.fitness.judging import judged
from tests.support.conditions import QUICK, STAY, WIDE


def fitness(condition=WIDE, **settings):
    return part("fitness", OmegaConf.create({"name": "layouts", **settings})).create(
        condition=condition
    )


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"layouts": 0}, "setting 'layouts' can't be 0: must be greater than 0"),
        (
            {"unseen": -1},
            "setting 'unseen' can't be -1: must be greater than or equal to 0",
        ),
        (
            {"combine": "median"},
            "no way to combine rewards 'median' in fitness.combine .*possible: mean, worst, worst_q",
        ),
        ({"sims": ["bullet"]}, "no sim 'bullet'"),
    ],
)
def test_a_wrong_setting_is_reported(settings, said):
    with pytest.raises(UserError, match=said):
        fitness(**settings)


def test_no_search_may_begin_among_the_unseen_layouts():
    for seed, layouts in ((UNSEEN, 5), (UNSEEN - 4, 5), (0, UNSEEN)):
        with pytest.raises(
            UserError,
            match=r"seed and fitness.layouts together must be at most 999000",
        ):
            fitness(replace(WIDE, layout=seed), layouts=layouts)


def test_layouts_that_are_all_the_same_are_refused():
    usual = replace(WIDE, task=PluginPart("task", "BringCube"))
    with pytest.raises(
        UserError,
        match=r"all layouts of BringCube are the same; add task.variation=near or task.varia",
    ):
        fitness(usual)
    # Its dust lies at random in any variation.
    fitness(replace(WIDE, task=PluginPart("task", "CleanTable")))


def test_it_combines_the_rewards_of_the_layouts_from_the_runs_seed_on():
    alone = [judged(Nominal(replace(WIDE, layout=seed)), STAY)[0] for seed in (3, 4)]
    rewards = [evaluation.reward for evaluation in alone]
    (mean,) = judged(fitness(layouts=2), STAY)
    (lowest,) = judged(fitness(layouts=2, combine="worst"), STAY)
    assert (mean.reward, lowest.reward) == (
        pytest.approx(np.mean(rewards)),
        min(rewards),
    )
    assert list(mean.by_engine["mujoco"]) == rewards
    poor = combined_figures(mean, WIDE.task.shared())["poor_layouts"]
    assert [layout["layout"] for layout in poor] in ([3, 4], [4, 3])
    assert all(0.85 <= layout["cube.x"] <= 1.05 for layout in poor)


@given(rewards=st.lists(st.floats(0, 1), min_size=1, max_size=40))
def test_the_worst_quarter(rewards):
    found = worst_quarter(rewards)
    assert min(rewards) - 1e-12 <= found <= np.mean(rewards) + 1e-12
    assert worst_quarter([0.0, 0.2, *[1.0] * 6]) == pytest.approx(0.1)


def test_a_tool_that_overlaps_some_layouts_at_spawn_is_rejected_there_and_tried_in_the_others():
    beside = Pose.xyz_rpy((0.25, -0.04, -0.48))
    tool = Tool(
        (Component("bar", "tool_mount", beside, Box((0.5, 0.02, 0.02)), 0.005),)
    )
    boxes = Condition(
        PluginPart("task", "LiftBox", (("variation", "wide"),)), WIDE.sim, 0, QUICK
    )
    (found,) = judged(fitness(boxes, layouts=3), replace(STAY, tool=tool))
    assert [(trial.layout, trial.status) for trial in found.trials] == [
        (0, "ok"),
        (1, "rejected"),
        (2, "rejected"),
    ]
    assert (found.status, found.rollouts) == ("ok", 1)
    assert found.reward == pytest.approx(found.trials[0].reward / 3)
    assert found.warnings[-1].startswith(
        "mujoco, layout 3 of 3: rejected: component 'bar' starts"
    )


def test_a_tool_that_overlaps_every_layout_at_spawn_is_rejected():
    inside = Pose.xyz_rpy((0.25, 0.0, -0.48))
    tool = Tool(
        (Component("bar", "tool_mount", inside, Box((0.5, 0.02, 0.02)), 0.005),)
    )
    boxes = Condition(
        PluginPart("task", "LiftBox", (("variation", "wide"),)), WIDE.sim, 0, QUICK
    )
    (found,) = judged(fitness(boxes, layouts=3), replace(STAY, tool=tool))
    assert (found.status, found.reward, found.rollouts) == ("rejected", 0.0, 0)
    assert "component 'bar' starts" in found.reason


def test_unseen_layouts_are_none_of_the_search_and_the_same_for_every_run():
    made = fitness(unseen=4)
    assert [condition.layout for condition in made.unseen()] == [
        UNSEEN,
        UNSEEN + 1,
        UNSEEN + 2,
        UNSEEN + 3,
    ]
    assert made.unseen() == fitness(replace(WIDE, layout=9), unseen=4).unseen()
    assert fitness(unseen=0).unseen() == []
    assert pickle.loads(pickle.dumps(made.unseen())) == made.unseen()


def test_unseen_layouts_may_be_in_engines_of_their_own():
    set_up = replace(WIDE, sim=PluginPart("sim", "mujoco", (("time_step", 0.001),)))
    made = fitness(set_up, unseen=1, unseen_sims=["mujoco", "sapien"])
    mujoco, sapien = made.unseen()
    assert (
        [mujoco.where.engine, sapien.where.engine]
        == [mujoco.sim.name, sapien.sim.name]
        == ["mujoco", "sapien"]
    )
    assert dict(mujoco.sim.settings)["time_step"] > 0.001
    assert "tried in 1 others, in each of mujoco, sapien." in made.instructions()
    assert "in each" not in fitness(unseen=1).instructions().replace("In each", "")


def test_finals_follow_the_layouts_of_the_search_each_in_all_engines():
    endless = fitness(layouts=2, unseen_sims=["mujoco", "sapien"]).finals()
    places = [
        [(condition.where.engine, condition.layout) for condition in alike]
        for alike in islice(endless, 2)
    ]
    assert places == [[("mujoco", seed), ("sapien", seed)] for seed in (5, 6)]


def test_the_prompt_says_how_exactly_plans_see():
    noisy = replace(WIDE, settings=replace(QUICK, perception=Perception(0.002, 0.01)))
    assert (
        "the standard deviations are 0.002 in x and in y, and 0.01 of yaw"
        in fitness(noisy).instructions()
    )
    assert "standard deviations" not in fitness().instructions()


def test_the_prompt_says_what_varies_and_what_counts():
    text = fitness(
        layouts=4, combine="worst", sims=["mujoco", "pybullet"]
    ).instructions()
    assert "in 4 layouts in each of the engines mujoco, pybullet" in text
    assert "cube.x from 0.85 to 1.05" in text
    assert "its lowest reward, in the engine where that is the lowest" in text


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_a_run_says_what_its_best_earns_in_unseen_layouts(tmp_path, capsys):
    words = [
        *(
            "task.variation=near",
            "sim=mujoco",
            "fitness=layouts",
            "fitness.layouts=2",
            "fitness.unseen=3",
        ),
        *(
            "budget=tiny",
            "budget.final_s=4",
        ),
        *("film=false", "listener=[]", "prompt.picture=false"),
    ]
    result = run(load("config", words), tmp_path / "run")
    found = json.loads((tmp_path / "run/result.json").read_text())
    assert found["held"]["layouts"] == 32
    assert (
        found["rollouts"]
        == sum(len(e["mujoco"]) for e in found["finalists"].values()) + 2
    )
    stored = found["unseen"]
    assert stored["engines"] == {"mujoco": list(result.unseen["mujoco"])}
    assert (stored["layouts"], stored["worst"]) == (3, min(result.unseen["mujoco"]))
    again = [
        play(condition, [result.best.candidate])[0].reward
        for condition in _unseen(words)
    ]
    assert again == stored["rewards"]
    assert read_run(tmp_path / "run").figures.unseen.mean == pytest.approx(
        stored["mean"]
    )
    resume(tmp_path / "run")
    assert "\nbest reward 0." in capsys.readouterr().out


def _unseen(words):
    cfg = load("config", words)
    condition = Condition(
        PluginPart("task", "BringCube", (("variation", "near"),)), part("sim", cfg.sim)
    )
    return part("fitness", cfg.fitness).create(condition=condition).unseen()
