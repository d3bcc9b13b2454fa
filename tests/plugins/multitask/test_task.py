"""Tasks that one tool must do, of which one names the fixture that a design brings."""

import pytest

from core.designs.reading import load_designs, read_designs
from core.designs.start import SpawnRules
from core.errors import UsageError
from core.plugins import installed
from core.scene import FIXTURE
from plugins.multitask.task import Multitask
from tests.support.panda import on_panda
from tests.support.scene_files import SCENES
from tests.support.text import replaced_all

pytestmark = pytest.mark.slow

(FUNNEL,) = [scene for scene in SCENES if scene.stem == "UseFunnel"]
(STRATEGY,) = load_designs(FUNNEL.with_suffix(".json"))["strategies"]
WITHOUT = {key: value for key, value in STRATEGY.items() if key != FIXTURE}
PLAN = [[0.5, 0.0, 0.5, 0.0, 0.0, 0.0]]
REGION = "fixture: {"
BEHIND = "fixture: {box: [0.3, 0.3, 0.4], position: [0.76, 0, 0.2]}"
ELSEWHERE = "fixture: {box: [0.1, 0.1, 0.1], position: [0.3, 0.5, 0.05]}"


def join(folder, region):
    """The funnel's task, whose goal names the fixture, and one with another place for it, or without one."""
    text = FUNNEL.read_text()
    named = folder / "named.yaml"
    named.write_text(replaced_all(text, ("inside: bottle", "inside: fixture")))

    lines = replaced_all(text, ("name: UseFunnel", "name: Other")).splitlines()
    other = folder / "other.yaml"
    other.write_text(
        "\n".join(region if line.startswith(REGION) else line for line in lines)
    )
    files = [{"name": "file", "file": str(file)} for file in (named, other)]
    return on_panda(Multitask(files))


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    return join(tmp_path_factory.mktemp("several"), BEHIND)


def read(task, strategy):
    boxes = installed().create("tool", "boxes")
    design = {**strategy, "action": "waypoints", "action_sets": [PLAN]}
    rules = SpawnRules(task)
    (candidate,) = read_designs({"strategies": [design]}, boxes, task, start=rules)
    return candidate.problem or ""


def test_a_fixture_stands_where_all_tasks_have_a_place_for_it(task):
    assert task.fixture.low == pytest.approx((0.61, -0.15, 0.0))
    assert task.fixture.high == pytest.approx((0.9, 0.15, 0.25))
    assert read(task, STRATEGY) == ""


def test_goals_of_one_task_that_name_the_fixture_ask_for_one(task):
    problem = read(task, WITHOUT)
    assert "in UseFunnel, the goals of UseFunnel name the fixture" in problem
    assert "Other" not in problem

    post = STRATEGY[FIXTURE]["tool_components"][:1]
    solid = {**STRATEGY, FIXTURE: {**STRATEGY[FIXTURE], "tool_components": post}}
    assert "in UseFunnel, fixture: bodies must end inside it" in read(task, solid)


@pytest.mark.parametrize(
    "region", ["", pytest.param(ELSEWHERE, marks=pytest.mark.thorough)]
)
def test_a_fixture_that_no_common_place_takes_is_said_at_once(tmp_path, region):
    with pytest.raises(UsageError) as error:
        join(tmp_path, region)

    line = str(error.value)
    assert "the goals of UseFunnel name the fixture, and these tasks have no" in line
