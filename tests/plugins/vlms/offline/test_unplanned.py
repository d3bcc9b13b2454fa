"""Which goals of a scene file the embedded designer plans for: each kind is planned for, or named when a run starts."""

import re
from pathlib import Path

import pytest

from core.design import DesignError
from core.goals import reaches
from core.interfaces import Brief
from core.plugins import installed
from plugins.tasks.file.goals import HEADS
from plugins.tasks.file.task import FileTask
from plugins.vlms.offline.layouts import make_layouts
from plugins.vlms.offline.sampler import Sampler
from plugins.vlms.offline.targets import find_targets
from plugins.vlms.offline.unplanned import find_unplanned
from tests.panda import on_panda

DOCS = Path(__file__).parents[4] / "docs" / "designer.md"
GOAL = "{bodies: [ball], place: [0.6, 0.2, null]}"
SCENE = f"""
name: Mixed
description: Many things, of which each goal wants something.
bodies:
  - {{name: ball, sphere: 0.02, position: [0.6, 0, 0.02], mass: 0.1, breaks_n: 15}}
  - {{name: stick, box: [0.1, 0.02, 0.02], position: [0.5, -0.2, 0.01], mass: 0.1}}
  - {{name: cup, cup: {{radius: 0.05, length: 0.06, wall: 0.004}}, position: [0.6, 0.3, 0.03], fixed: true}}
  - {{name: lid, box: [0.1, 0.1, 0.02], position: [0.8, -0.3, 0.1], mass: 0.2}}
joints:
  - {{name: slide, kind: slider, body: lid, axis: [1, 0, 0], lower: 0, upper: 0.2}}
goals:
  - {GOAL}
"""
SOFT = """
  - {name: slab, box: [0.06, 0.06, 0.03], position: [0.5, 0.3, 0.015], elastic: {density: 400, young: 5000}}
joints:"""

REGION = """
fixture: {box: [0.2, 0.2, 0.2], position: [0.8, 0.2, 0.1]}
joints:"""

ASKED = {
    "place": GOAL,
    "places": "{bodies: [ball, stick], places: [[0.6, 0.2, 0.02], [0.5, 0, 0.01]]}",
    "inside": "{bodies: [ball], inside: cup}",
    "away": "{bodies: [ball], away: 0.1}",
    "joint": "{joint: slide, to: 0.1}",
    "moved": "{bodies: [ball], moved: [0.1, null, null]}",
    "raised": "{bodies: [ball], raised: 0.1}",
    "apart": "{bodies: [ball, stick], apart: 0.4}",
    "max_height_m": "{bodies: [slab], max_height_m: 0.02}",
    "min_area_m2": "{bodies: [slab], min_area_m2: 0.005}",
    "axis": "{bodies: [stick], axis: [1, 0, 0], points: [0, 0, 1]}",
    "angle_deg": "{bodies: [stick], axis: [1, 0, 0], points: [0, 0, 1], angle_deg: '< 30'}",
    "turned_deg": "{bodies: [stick], turned_deg: '> 30'}",
    "facing": "{bodies: [stick], facing: cup}",
    "keep": "{keep: [stick]}",
    "untouched": "{untouched: [cup]}",
    "broken": "{broken: [ball]}",
    "unbroken": "{unbroken: [ball]}",
}
"""A goal of each kind, by its key."""

MORE = {
    "max_force_n": "{untouched: [cup], max_force_n: 5}",
    "by": "{untouched: [cup], by: [stick]}",
    "throughout": "{bodies: [ball], raised: '< 0.2', throughout: true}",
    "by_s": "{bodies: [ball], away: 0.1, by_s: 3}",
    "fixture": "{bodies: [ball], inside: fixture}",
    "node": "{bodies: [slab], node: 0, place: [0.6, null, null]}",
}
"""Goals with keys that no kind is named by."""

LIMITS = {"keep", "untouched", "unbroken", "max_force_n", "by", "throughout"}


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """What is named as unplanned, and the goals that are reached by nothing, by the key of each goal."""
    found = {}
    for key, goal in (ASKED | MORE).items():
        file = tmp_path_factory.mktemp(key) / "scene.yaml"
        text = SCENE
        if "slab" in goal:
            text = SCENE.replace("\njoints:", SOFT)
        if "fixture" in goal:
            text = SCENE.replace("\njoints:", REGION)

        asked = f"{GOAL}\n  - {goal}" if key in LIMITS else goal
        file.write_text(text.replace(GOAL, asked))
        task = FileTask(str(file))
        scene = task.scene(0)
        targets = [t for g in reaches(task.goals) for t in find_targets(g, scene)]
        aims = [t.place or t.away or t.axis or t.joint or t.breaks for t in targets]
        aimless = [target for target, aim in zip(targets, aims, strict=True) if not aim]
        lines = find_unplanned(task, 0)
        found[key] = [line for line in lines if "gives way" not in line], aimless

    return found


def test_every_kind_of_goal_is_looked_at():
    assert ASKED.keys() == HEADS.keys()


@pytest.mark.parametrize("key", sorted(ASKED.keys() - LIMITS))
def test_each_kind_of_goal_is_planned_for_or_named(named, key):
    lines, aimless = named[key]
    assert bool(lines) == bool(aimless)


def test_the_page_of_the_designer_lists_what_is_named(named):
    text = DOCS.read_text()
    (sentence,) = re.findall(r"it does not plan for [^.]*\.", text)
    listed = set(re.findall(r"`([a-z0-9_]+)`", sentence))
    assert listed == {key for key, (lines, _) in named.items() if lines}


def test_a_goal_that_names_a_fixture_does_not_cost_its_designs_their_tries(tmp_path):
    """The embedded designer brings no fixture: its tools are rejected where they are tried, and say why."""
    file = tmp_path / "scene.yaml"
    text = SCENE.replace("\njoints:", REGION)
    file.write_text(text.replace(GOAL, MORE["fixture"]))
    task = on_panda(FileTask(str(file)))
    tools = installed().create("tool", "urdf")
    actions = installed().create("action", "waypoints")
    brief = Brief(task, 0, tools, False, 1, 1, 0, 0, 0, actions=actions)
    sampler = Sampler(brief, make_layouts(brief))
    tool = sampler.invent().tool
    assert sampler.accepts(tool)
    with pytest.raises(DesignError, match="name the fixture, and the design has none"):
        sampler.layout.spawn.check(tool)
