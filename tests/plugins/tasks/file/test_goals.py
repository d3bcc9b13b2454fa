"""What an entry of a scene file's goals stands for, and the kinds of goals that only files have."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from core.geometry import Box, Pose
from core.goals import (
    Away,
    Facing,
    Flattened,
    Kept,
    Placed,
    Reach,
    Spread,
    Turned,
    Untouched,
    goals_reward,
)
from core.scene import Elastic, Filling, Scene, Soft
from plugins.new.new_command import write_scene
from plugins.tasks.file.goals import (
    join_entries,
    read_entry,
)

RED = (1, 0, 0, 1)
ROOT = Path(__file__).parents[4]


def reward(goal, end, start):
    task = SimpleNamespace(goals=(goal,), every=False)
    return np.round(goals_reward(task, start, end), 9)


def test_an_entry_of_a_file_is_one_goal_to_reach_and_its_limits():
    place = {"place": (0.5, None, None), "tolerance": 0.01, "rest": True}
    reached, kept = read_entry(
        {"bodies": ("cup",), **place, "axis": (0, 0, 1), "keep": ("jug",)}
    )
    assert reached == Placed(
        ("cup",), **place, also=(Turned(("cup",), axis=(0, 0, 1), rest=True),)
    )
    assert kept == Kept(("jug",))
    assert read_entry({"bodies": ("cup",), "held": True}) == (
        Reach(("cup",), held=True),
    )


def test_a_body_to_keep_all_the_time_is_said_in_two_ways():
    kept = (Kept(("jug",), throughout=True),)
    assert read_entry({"keep": ("jug",), "throughout": True}) == kept
    assert read_entry({"bodies": ("jug",), "keep": "throughout"}) == kept
    near = {"bodies": ("jug",), "keep": "throughout", "kept_m": 0.1}
    assert read_entry(near) == (Kept(("jug",), 0.1, throughout=True),)
    assert kept[0].describe().startswith("leave jug in place throughout: ")
    for unclear in ({}, {"bodies": ("cup",), "place": (0.5, 0, None)}):
        with pytest.raises(ValueError, match=r"write keep: \[NAME, ...\]"):
            read_entry({**unclear, "keep": "throughout"})


def test_a_body_is_released_wherever_it_is_or_at_its_place():
    assert read_entry({"bodies": ("cup",), "released": True}) == (
        Reach(("cup",), released=True),
    )
    place = {"place": (0.5, None, None), "tolerance": 0.01, "released": True}
    (goal,) = read_entry({"bodies": ("cup",), **place})
    assert goal == Placed(("cup",), **place)
    assert "must end released, touched by no part of the robot" in goal.describe()
    with pytest.raises(ValueError, match="say the opposite"):
        read_entry({"bodies": ("cup",), "held": True, "released": True})


def test_after_counts_the_entries_of_a_file():
    entries = [
        (Kept(("jug",)), Untouched(("jug",))),
        (Away(("cup",), away=0.1),),
        (Away(("pot",), away=0.1, after=1), Kept(("cup",))),
    ]
    assert join_entries(entries)[3].after == 2


def test_soft_bodies_get_a_node_to_a_place_flat_and_wide():
    form = Filling(Box((0.1, 0.1, 0.04)))
    slab = Soft.make(
        "slab",
        form,
        Elastic(400, 5e3),
        Pose.xyz_rpy((0.5, 0, 0.02)),
        color=RED,
    )
    start = Scene((slab,)).state()

    def pressed(x, z):
        return replace(start, soft={"slab": start.nodes("slab") * [x, 1, z]})

    flat = Flattened(("slab",), max_height_m=0.02)
    wide = Spread(("slab",), min_area_m2=0.02)
    assert (
        reward(flat, pressed(1, 0.5), start) == reward(wide, pressed(2, 1), start) == 1
    )
    assert (
        reward(flat, pressed(1, 0.75), start)
        == reward(wide, pressed(1.5, 1), start)
        == 0.5
    )
    corner = Placed(("slab",), node=0, place=(0.9, None, None))
    np.testing.assert_allclose(reward(corner, pressed(1.5, 1), start), 0.5)


@pytest.mark.parametrize(
    ("enough", "said"),
    [
        (1.0, "all of these bodies are needed"),
        (1, "one of these bodies is enough"),
        (0.8, "of these bodies 80 % are enough"),
        (3, "of these bodies 3 are enough"),
    ],
)
def test_how_many_are_enough_is_said_in_words(enough, said):
    (goal,) = read_entry({"bodies": ("a", "b", "c"), "away": 0.1, "enough": enough})
    assert goal.describe().endswith(f"; {said}")


def test_a_body_that_faces_another_is_said_in_words():
    (goal,) = read_entry({"bodies": ("lamp",), "facing": "book", "axis": (0, 1, 0)})
    assert goal == Facing(("lamp",), facing="book", axis=(0, 1, 0))
    assert goal.describe() == (
        "lamp axis (0, 1, 0) of its frame must point at book, within 10 degrees"
    )


@pytest.mark.parametrize(
    ("joined", "also"),
    [
        (
            {"place": (0.5, None, None), "axis": (0, 0, 1)},
            {"place": (0.5, None, None), "also": ({"axis": (0, 0, 1)},)},
        ),
        (
            {"away": 0.1, "facing": "jug", "turned_deg": 30, "rest": True},
            {
                "away": 0.1,
                "rest": True,
                "also": ({"turned_deg": 30}, {"facing": "jug"}),
            },
        ),
    ],
)
def test_joined_keys_and_also_are_one_thing(joined, also):
    bodies = {"bodies": ("cup", "pot"), "enough": 1}
    assert read_entry(bodies | joined) == read_entry(bodies | also)


def test_what_is_also_wanted_alone_is_a_goal():
    place = {"place": (0.5, None, None)}
    (goal,) = read_entry({"bodies": ("cup",), "also": (place,)})
    assert goal == read_entry({"bodies": ("cup",), **place})[0]


STRANGER = '''
from dataclasses import dataclass, replace
from typing import ClassVar

from core.goals import FREE_BODY, Key, Measure, Names, Reach
from core.hooks import hookimpl


@dataclass(frozen=True, kw_only=True)
class Above(Reach):
    """Bodies that must end higher than ``height``, m."""

    height: float

    keys: ClassVar = {"height_m": Key(float, "How high they must end, m", head=True)}
    asks = "must end above {{ goal.height | g }} m"
    short = "lift {{ bodies }}"

    def measures(self, body, start):
        def z(state):
            return state.position(body)[..., 2]

        return [Measure(f"height of {body}", z, self.height, 0.1, "m", at_least=True)]

    @classmethod
    def translate(cls, key, given):
        return {"height": given[key]}


@dataclass(frozen=True, kw_only=True)
class Level(Reach):
    """Bodies, named by a key of their own, that must end equally high."""

    level: tuple[str, ...]

    keys: ClassVar = {"level": Key(Names, "Bodies that must end equally high", head=True)}
    names: ClassVar = {"level": FREE_BODY}

    def measures(self, body, start):
        def off(state):
            return abs(state.position(body) - state.position(self.level[0]))[..., 2]

        return [Measure(f"{body} off the height of the first", off, 0.01, 0.1, "m")]

    def fit(self, site):
        return replace(self, bodies=self.level)


@hookimpl
def goals():
    return {"above": Above, "level": Level}
'''
RUN = """
import sys

import stranger
from core.plugins import installed

installed().register(stranger, "stranger", "strangers-goals")
from plugins.tasks.file.task import FileTask

task = FileTask(sys.argv[1])
above, level = task.goals
print(above, above.in_short(), task.reward_in_words()[0], level.bodies, sep="\\n")
"""


def test_plugins_kinds_of_goals_are_in_scene_files(tmp_path):
    """One takes `bodies`; the other names them by a key of its own, and has them once its patterns are read."""
    (tmp_path / "stranger.py").write_text(STRANGER)
    file = write_scene("PushBlock", tmp_path / "push.yaml")
    text = file.read_text().partition("\ngoals:")[0]
    goal = "{bodies: [block], height_m: 0.3, rest: true}"
    file.write_text(f"{text}\ngoals:\n  - {goal}\n  - {{level: ['bl*']}}\n")
    paths = os.pathsep.join((str(tmp_path), str(ROOT)))
    ran = subprocess.run(
        [sys.executable, "-c", RUN, str(file)],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        check=True,
    )
    made, short, words, found = ran.stdout.splitlines()
    assert made.startswith("Above(bodies=('block',)")
    assert "height=0.3" in made
    assert short == "lift block"
    assert words == "0. block must end above 0.3 m; must end at rest"
    assert found == "('block',)"
