"""What each kind of goal says in words, and what it means in physics: the file of its name in ``goals/`` has the data.

``rows`` have a word, a goal that is met by a little, and what of it makes another that is missed by a little. They are
played in `lanes.yaml`; in the ``scene`` that is named; or in one of the file's own ``bodies``, ``marks`` and
``joints``. ``short`` is what the first row wants, in a few words. ``planned: false``: its `Want` does not say all.
"""

from pathlib import Path

import pytest
import yaml

from core.goals import KINDS, Limit, Reach
from tests.support.engines import SIMULATORS
from tests.support.lanes import (
    GOAL,
    LANES,
    SOFTS,
    STAYED,
    check_first_alone_is_met,
    play,
    read,
)
from tests.support.text import replaced_all

HERE = Path(__file__).parent
SAID = {
    file.stem: yaml.safe_load(file.read_text())
    for file in sorted((HERE / "goals").glob("*.yaml"))
}
KIND = {kind.__module__.rpartition(".")[2]: kind for kind in KINDS}
ROWS = [(name, *row) for name, said in SAID.items() for row in said["rows"]]


def test_each_kind_has_a_file():
    assert SAID.keys() == KIND.keys()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("goals")


def find_scene(name, folder):
    """Find where a kind is played: the scene, what stands there as its goal, and the engines."""
    said = SAID[name]
    if "scene" in said:
        assert HERE / said["scene"] == SOFTS
        return SOFTS, STAYED, ["mujoco"]
    if "bodies" not in said:
        return LANES, GOAL, SIMULATORS

    things = {key: said[key] for key in ("bodies", "marks", "joints") if key in said}
    words = {"name": "Alone", "description": f"What the kind {name} means, by itself."}
    goal = said.get("beside", said["rows"][0][1])
    file = folder / f"{name}.yaml"
    file.write_text(f"{yaml.safe_dump(words | things)}goals:\n  - {goal}\n")
    return file, goal, SIMULATORS


def read_goal(name, asked, folder):
    """Read a scene with a goal; a limit stands beside one that is met."""
    scene, goal, _ = find_scene(name, folder)
    goals = [goal, asked] if issubclass(KIND[name], Limit) else [asked]
    return read(folder, goals, scene, goal)


@pytest.mark.parametrize("row", ROWS, ids=[f"{row[0]}: {row[1]}" for row in ROWS])
def test_a_word_means_the_same_in_every_engine(folder, row):
    name, _, goal, old, new = row
    tasks = [
        read_goal(name, asked, folder)
        for asked in (goal, replaced_all(goal, (old, new)))
    ]
    scene, _, engines = find_scene(name, folder)
    for engine in engines:
        check_first_alone_is_met(tasks, play(engine, scene), engine)


@pytest.mark.parametrize("name", SAID)
def test_a_kind_says_in_words_what_it_asks(name, folder):
    task = read_goal(name, SAID[name]["rows"][0][1], folder)
    (goal,) = [goal for goal in task.goals if isinstance(goal, KIND[name])]
    words = goal.describe()
    assert type(goal).__name__ not in words
    for _, named in goal.list_named():
        assert named in words


@pytest.mark.parametrize("name", [n for n in SAID if issubclass(KIND[n], Reach)])
def test_a_kind_to_reach_says_in_short_what_is_done_and_where(name, folder):
    said = SAID[name]
    task = read_goal(name, said["rows"][0][1], folder)
    (goal,) = task.goals
    assert goal.in_short() == said["short"]
    if goal.bodies:
        held = Reach(goal.bodies, held=True, also=(goal,))
        assert held.in_short() == said["short"]

    (want, *_) = goal.wants(task.scene(0))
    wanted = (want.place, want.away, want.axis, want.joint, want.breaks)
    planned = said.get("planned", True)
    assert any(wanted) == planned
    assert want.unsaid == (() if planned else (type(goal).__name__,))
