"""Each rung of the ladder is drawn the same each time, is a scene that files can say, and gets harder."""

import json
import re
from typing import get_args

import numpy as np
import pytest

from core.config.compose import load, node, task_part
from core.designs.planning import look
from core.errors import UsageError, UserError
from core.goals import are_goals_met
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.scene import Trace
from tasks.ladder.rung import NOISES_M, noise_at
from tasks.ladder.task import FAMILIES, MOST_NOISE_M, Name, draw_rung

every_family = pytest.mark.parametrize("family", sorted(FAMILIES))


def make(family, level=1, seed=0):
    settings = {"family": family, "level": level, "seed": seed}
    return installed().create("task", "ladder", settings)


@every_family
def test_a_level_and_a_seed_draw_one_rung(family):
    first, scene = draw_rung(family, 3, 5)
    again, same = draw_rung(family, 3, 5)
    assert scene == same
    assert first == again
    assert draw_rung(family, 3, 6)[1] != scene
    assert draw_rung(family, 4, 5)[1] != scene


@every_family
@pytest.mark.parametrize("level", [1, 2, 3, 4, 7, 40])
def test_every_level_is_a_scene_in_which_nothing_is_done_yet(family, level):
    task = make(family, level, 2)
    start = task.scene(0).complete(task.scene(0).state())
    assert task.variation == "wide"
    assert list(task.find_warnings()) == []
    assert list(task.warnings) == []
    assert not are_goals_met(
        task, start, start, Trace.of(start, start, forces={}, strains={})
    )


@every_family
def test_no_model_is_shown_the_design_that_solves_it(family):
    task = make(family)
    reference = json.dumps(dict(task.proof.reference))
    for word in ("tool_components", "funnel", "arc_1", "narrow fork"):
        assert word not in task.source()
        assert word not in task.description
    assert "tool_components" in reference


@every_family
def test_words_for_pictures_have_no_numbers(family):
    told = make(family, 5).in_words
    assert len(told.split()) > 15
    assert not re.search(r"\d", told)


def test_settings_name_the_families_that_there_are():
    assert sorted(get_args(Name)) == sorted(FAMILIES)
    assert {*MOST_NOISE_M} <= {*FAMILIES}


def test_places_are_seen_worse_from_level_to_level_and_no_better_than_a_run_asks():
    assert [noise_at(level) for level in (1, 2, 3, 4, 5, 99)] == [
        *NOISES_M,
        NOISES_M[-1],
        NOISES_M[-1],
    ]
    settings = RolloutSettings()
    for level in (1, 3):
        seen = make("sort", level).perceive(settings.perception)
        assert seen.position == noise_at(level)

    worse = node(
        load("evaluate", ["rollout.perception.position=0.05"]).rollout, RolloutSettings
    )
    assert make("sort", 3).perceive(worse.perception).position == 0.05


def test_what_a_plan_sees_is_off_by_as_much():
    task = make("sort", 4)
    scene = task.scene(0)
    offs = []
    for seed in range(100):
        seen = look(task, seed, RolloutSettings().perception, scene).poses
        way = seen["red_0"].position - scene["red_0"].pose.position
        offs.append(way)

    deviation = np.std(offs, axis=0)
    assert deviation == pytest.approx([noise_at(4), noise_at(4), 0.0], rel=0.25)


def test_the_words_of_a_rung_need_no_group_before_them():
    words = ["task=ladder", "family=tunnel", "level=4", "seed=3"]
    for command in ("config", "evaluate"):
        config = load(command, words)
        assert config.task.family == "tunnel"
        assert config.task.level == 4
        assert config.task.seed == 3
        assert task_part(config).create().name == "Tunnel4Seed3"

    other = load("config", [*words, "task.seed=8"])
    assert (other.seed, other.task.seed) == (3, 8)


def test_what_no_task_has_is_still_refused():
    with pytest.raises(UserError, match="family"):
        load("config", ["task=OneBook", "family=sort"])


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"level": 0}, "at least 1"),
        ({"seed": -1}, "at least 0"),
        ({"family": "none"}, "family"),
    ],
)
def test_what_is_no_rung_is_refused(settings, words):
    with pytest.raises(UsageError, match=words):
        installed().create("task", "ladder", settings)
