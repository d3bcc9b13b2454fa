"""Goals that one head can't reach together: their order, and a tool with a head for each."""

import pytest

from core.interfaces import Brief
from core.plugins import installed
from plugins.tasks.file.task import FileTask
from plugins.vlms.offline.chaining import invent, use_again
from plugins.vlms.offline.errands import find_errands, spread_goals
from plugins.vlms.offline.layouts import make_layouts
from plugins.vlms.offline.sampler import Sampler
from tests.panda import on_panda

OPENED = "{name: opened, joint: runner, to: '> 0.12'}"
SHUT = "{name: shut, joint: runner, to: '< 0.02'}"
INTO = "{name: filled, bodies: [cube], inside: drawer}"
PRESSED = "{name: pressed, joint: click, to: '> 0.01', ever: true}"
ASIDE = "{bodies: [cube], moved: [0, -0.1, null]}"

SCENE = """
name: Errands
description: A drawer in a cabinet, a button, and a cube.
bodies:
  - name: cabinet
    fixed: true
    position: [0.8, 0, 0]
    parts:
      - {box: [0.24, 0.24, 0.01], position: [0, 0, 0.115]}
      - {box: [0.24, 0.01, 0.11], position: [0, 0.115, 0.055]}
      - {box: [0.24, 0.01, 0.11], position: [0, -0.115, 0.055]}
      - {box: [0.01, 0.22, 0.11], position: [0.115, 0, 0.055]}
  - name: drawer
    at: cabinet
    position: [PLACE, 0, 0.01]
    mass: 0.6
    parts:
      - {box: [0.01, 0.21, 0.08], position: [0, 0, 0.04]}
      - {box: [0.2, 0.2, 0.008], position: [0.1, 0, 0.004]}
      - {box: [0.2, 0.008, 0.06], position: [0.1, 0.096, 0.03]}
      - {box: [0.2, 0.008, 0.06], position: [0.1, -0.096, 0.03]}
      - {box: [0.008, 0.2, 0.06], position: [0.2, 0, 0.03]}
      - {box: [0.03, 0.05, 0.012], position: [-0.02, 0, 0.05]}
      - {box: [0.01, 0.05, 0.03], position: [-0.04, 0, 0.05]}
  - {name: post, box: [0.04, 0.06, 0.2], position: [0.7, 0.3, 0.1], fixed: true}
  - {name: button, box: [0.03, 0.03, 0.03], position: [0.66, 0.3, 0.15], mass: 0.05}
  - {name: cube, box: [0.04, 0.04, 0.04], position: [0.5, -0.2, 0.02], mass: 0.1}
joints:
  - {name: runner, kind: slider, body: drawer, parent: cabinet, axis: [-1, 0, 0], lower: 0, upper: 0.16, start: START}
  - {name: click, kind: slider, body: button, parent: post, axis: [1, 0, 0], lower: 0, upper: 0.015, stiffness: 100}
every: true
goals:
  - GOALS
"""


@pytest.fixture
def sampler(tmp_path):
    """Return a function that makes the sampler for goals, with the drawer shut, or open."""

    def make(*goals, is_open=False):
        start = 0.14 if is_open else 0.0
        text = SCENE.replace("PLACE", str(-0.12 - start)).replace("START", str(start))
        file = tmp_path / "scene.yaml"
        file.write_text(text.replace("GOALS", "\n  - ".join(goals)))
        tools = installed().create("tool", "urdf")
        actions = installed().create("action", "waypoints")
        task = on_panda(FileTask(str(file)))
        brief = Brief(task, 0, tools, False, 1, 1, 0, 0, 0, actions=actions)
        return Sampler(brief, make_layouts(brief))

    return make


@pytest.mark.parametrize(
    ("goals", "is_open", "order"),
    [
        ((OPENED, INTO), False, [[0], [1]]),
        ((INTO, OPENED), False, [[1], [0]]),  # it opens the way
        ((SHUT, INTO), True, [[1], [0]]),  # it closes it
        ((ASIDE, PRESSED), False, [[0], [1]]),  # nothing decides
        ((ASIDE.replace("null]", "null], after: pressed"), PRESSED), False, [[1], [0]]),
        ((OPENED,), False, [[0]]),
        ((ASIDE,), False, [[0]]),
    ],
)
def test_what_opens_a_way_comes_first_and_what_closes_it_last(
    sampler, goals, is_open, order
):
    analysis = spread_goals(sampler(*goals, is_open=is_open).analysis)
    assert find_errands(analysis) == order


def test_what_is_opened_takes_along_where_things_are_to_go(sampler):
    analysis = sampler(OPENED, INTO).analysis
    (runner, cube) = analysis.goals
    (first, _) = analysis.draw_subgoals(sampler(OPENED, INTO).rng)
    _, later = analysis.after([first]).goals
    assert later.place[0] == pytest.approx(cube.place[0] - runner.to, abs=1e-6)
    assert later.place[1:] == cube.place[1:]


def test_a_tool_has_a_head_for_each_errand_and_a_plan_does_all(sampler):
    whole = sampler(PRESSED, ASIDE)
    design = invent(whole)
    assert len(design.parts) == 2
    assert whole.accepts(design.tool)
    counts = [len(part.design.tool.components) for part in design.parts]
    assert len(design.tool.components) == sum(counts)
    assert len({part.name for part in design.tool.components}) == sum(counts)

    other = use_again(design, design.tool, whole)
    for plan in (design.plan, other):
        assert "; then " in plan.text
        assert len(plan.rows) == len(plan.anchors) == len(plan.touching)
