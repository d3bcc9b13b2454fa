"""A scene with benches that fit photographs: which of them the search, the choice of the winner and the end take."""

import pytest

from core import Experiment
from core.interfaces import Condition, RolloutSettings
from core.plugins import PluginPart
from plugins.fitness.layouts import UNSEEN, Layouts
from plugins.new.new_command import write_scene


@pytest.fixture
def scene(tmp_path):
    """A scene with so many benches."""

    def write(count):
        file = write_scene("PushBlock", tmp_path / "push.yaml")
        values = [round(0.9 + 0.001 * number, 4) for number in range(count)]
        text = file.read_text()
        head = "\nvariations:\n"
        seen = f"{head}  seen:\n    bodies.block.position.x: {values}\n"
        assert head in text
        file.write_text(text.replace(head, seen, 1))
        return file

    return write


@pytest.mark.parametrize("layouts", [1, 5, 30, 64, 70])
@pytest.mark.parametrize("seed", [0, 7])
def test_no_bench_is_tried_twice(scene, layouts, seed):
    count = 64
    settings = (("file", str(scene(count))), ("variation", "seen"))
    task = PluginPart("task", "file", settings)
    sim = PluginPart("sim", "mujoco")
    fitness = Layouts(Condition(task, sim, seed, RolloutSettings()), layouts)

    searched = {condition.layout % count for condition in fitness.conditions()}
    finals = [where.layout % count for group in fitness.finals() for where in group]
    unseen = [where.layout for where in fitness.unseen()]
    assert all(layout >= UNSEEN for layout in unseen)
    others = [*finals, *(layout % count for layout in unseen)]
    assert len(others) == len(set(others)) == count - len(searched)
    assert searched.isdisjoint(others)
    assert len(unseen) == min(20, (count - len(searched)) // 2)


@pytest.mark.parametrize(
    ("words", "variation", "fitness"),
    [
        ([], "seen", "layouts"),
        (["task.variation=none"], "none", "nominal"),
        (["task.variation=seen"], "seen", "nominal"),
        (["fitness=robust"], "none", "robust"),
    ],
)
def test_a_scene_that_was_seen_is_searched_so(scene, capsys, words, variation, fitness):
    made = Experiment("task=file", f"task.file={scene(3)}", *words)
    found = made.config.task.variation, made.config.fitness.name
    assert found == (variation, fitness)
    said = capsys.readouterr().err
    line = "PushBlock is searched with task.variation=seen fitness=layouts"
    assert (line in said) == (not words)
