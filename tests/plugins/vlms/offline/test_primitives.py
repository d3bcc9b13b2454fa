"""Motions of heads that the embedded designer draws: where they take bodies, carry them to, and let go of them."""

from itertools import pairwise

import numpy as np
import pytest

from core.geometry import Pose
from core.interfaces import Brief
from core.plugins import installed
from plugins.actions.waypoints import WaypointActions
from plugins.tasks.file.task import FileTask
from plugins.vlms.offline.head_sampling import draw_clamp, draw_head
from plugins.vlms.offline.layouts import make_layouts
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.primitives import PRIMITIVES
from plugins.vlms.offline.reaching_in import make_straight_mover
from plugins.vlms.offline.sampler import Sampler
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from plugins.vlms.offline.tool_building import build_clamp
from plugins.vlms.offline.tool_parts import guess_head
from tests.panda import on_panda

PLANS = 40
RIM_M = 0.08
CUP = f"""
  - {{name: cube, box: [0.03, 0.03, 0.03], position: [0.5, 0, 0.015], mass: 0.05}}
  - {{name: cup, cup: {{radius: 0.05, length: {RIM_M}, wall: 0.004}}, position: [0.5, 0.3, {RIM_M / 2}], fixed: true}}
"""
BAR = """
  - {name: bar, box: [0.02, 0.5, 0.02], position: [0.5, 0, 0.01], mass: 0.1}
"""
POST = """
  - {name: post, cylinder: {radius: 0.03, length: 0.4}, position: [0.5, 0, 0.2], mass: 0.1}
"""
TRAY = """
  - {name: cube, box: [0.04, 0.04, 0.04], position: [0.5, -0.1, 0.02], mass: 1, repeat: {grid: [1, 2, 1], spacing: 0.2}}
  - {name: tray, cup: {radius: 0.15, length: 0.08, wall: 0.004}, position: [0.8, 0, 0.04], fixed: true}
"""

SHELF = """
  - {name: parcel, box: [0.06, 0.1, 0.05], position: [0.8, 0, 0.025], mass: 0.25}
  - {name: board, box: [0.4, 0.5, 0.02], position: [0.75, 0, 0.13], fixed: true}
"""


@pytest.fixture
def ask(tmp_path):
    """Ask for designs for a scene of some bodies with one goal."""

    def ask_for(bodies, goal, gripper=True):
        file = tmp_path / "scene.yaml"
        file.write_text(
            "name: Moved\n"
            "description: Something has to get somewhere.\n"
            f"bodies:{bodies}goals:\n  - {goal}\n"
        )
        task = on_panda(FileTask(str(file)))
        tool = installed().create("tool", "urdf")
        actions = WaypointActions()
        return Brief(task, 0, tool, gripper, 1, 1, 0, 0, 7, (), actions=actions)

    return ask_for


@pytest.fixture
def analyse(ask):
    """Analyse a scene of some bodies with one goal."""
    return lambda *given, **more: SceneAnalysis(ask(*given, **more))


def clamp(analysis, rng):
    """Draw a subgoal, pads, and a path of them."""
    (subgoal,) = analysis.draw_subgoals(rng)
    head = draw_clamp(subgoal, rng)
    path = HeadPath()
    PRIMITIVES["clamp"](path, subgoal, head, rng)
    return subgoal, head, path


def find_grasp(path):
    return path.poses[list(pairwise(path.grips)).index((0.0, 1.0))]


def open_at(analysis, rng):
    """How high above the table the body's foot is where the fingers open, m."""
    subgoal, _, path = clamp(analysis, rng)
    opened = path.poses[list(pairwise(path.grips)).index((1.0, 0.0))]
    return subgoal.lower[2] + opened.position[2] - find_grasp(path).position[2]


def test_a_body_is_mostly_let_fall_into_a_hollow_from_above_its_rim(analyse):
    analysis = analyse(CUP, "{bodies: [cube], inside: cup, released: true}")
    rng = np.random.default_rng(0)
    heights = np.array([open_at(analysis, rng) for _ in range(PLANS)])
    assert 0.4 < np.mean(heights > RIM_M) < 1


def test_at_a_place_it_is_set_down(analyse):
    analysis = analyse(CUP, "{bodies: [cube], at: cup, place: [0.2, 0, null]}")
    rng = np.random.default_rng(0)
    assert max(open_at(analysis, rng) for _ in range(PLANS)) < 0.01


def test_what_goes_into_one_hollow_one_by_one_lies_there_side_by_side(analyse):
    analysis = analyse(TRAY, '{bodies: ["cube_*"], inside: tray}')
    rng = np.random.default_rng(0)
    for _ in range(PLANS):
        subgoals = analysis.draw_subgoals(rng, alone=True)
        ends = [subgoal.center + subgoal.shift for subgoal in subgoals]
        assert 0.035 < np.linalg.norm(ends[0] - ends[1]) < 0.21


def test_fingers_put_each_body_into_a_hollow_by_itself(analyse):
    """Of several in one grip some are lost over its rim; a scoop may hold them all."""
    rng = np.random.default_rng(0)
    goal = '{bodies: ["cube_*"], inside: tray}'
    counts = {}
    for gripper in (True, False):
        analysis = analyse(TRAY, goal, gripper=gripper)
        drawn = [analysis.draw_subgoals(rng) for _ in range(PLANS)]
        counts[gripper] = {len(subgoals) for subgoals in drawn}

    assert counts == {True: {2}, False: {1, 2}}


@pytest.mark.parametrize(("rest", "waits"), [("true", True), ("false", False)])
def test_a_plan_waits_for_what_must_come_to_rest(ask, rest, waits):
    """A ball may roll for longer than the robot holds still after a plan."""
    goal = f"{{bodies: [cube], at: cup, place: [-0.1, 0, null], rest: {rest}}}"
    brief = ask(CUP, goal, gripper=False)
    plan = Sampler(brief, make_layouts(brief)).invent().plan
    last = plan.rows[-5:]
    assert len(plan.rows) == len(plan.anchors) == len(plan.touching)
    assert np.allclose(last, last[0]) == waits


def test_what_goes_into_a_hollow_may_end_on_its_nearer_side(analyse):
    analysis = analyse(TRAY, '{bodies: ["cube_*"], inside: tray}')
    rng = np.random.default_rng(0)
    ends = []
    for _ in range(PLANS):
        subgoals = analysis.draw_subgoals(rng, alone=True)
        ends += [(subgoal.center + subgoal.shift)[0] for subgoal in subgoals]

    assert min(ends) > 0.65 + 0.02
    assert 0.7 < np.mean(ends) < 0.78
    assert max(ends) < 0.81


def test_what_stands_free_is_not_enclosed_by_where_it_goes(analyse):
    """So that fingers may reach ahead of the hand."""
    analysis = analyse(CUP, "{bodies: [cube], inside: cup}")
    (subgoal,) = analysis.draw_subgoals(np.random.default_rng(0))
    assert not subgoal.is_enclosed


def test_a_long_body_is_gripped_across_its_narrow_side(analyse):
    analysis = analyse(BAR, "{bodies: [bar], raised: 0.1, held: true}")
    rng = np.random.default_rng(0)
    for _ in range(PLANS):
        _, head, path = clamp(analysis, rng)
        closing = find_grasp(path).rotation_matrix[:, 1]
        assert 0.02 < head.width < 0.1
        assert abs(closing[0]) > 0.9


def test_a_tall_body_hangs_from_the_pads(analyse):
    analysis = analyse(POST, "{bodies: [post], raised: 0.1, held: true}")
    rng = np.random.default_rng(0)
    for _ in range(PLANS):
        _, head, path = clamp(analysis, rng)
        middle = find_grasp(path).position[2] + head.attachment[2] / 2
        assert 0.2 <= middle < 0.4


@pytest.mark.parametrize("primitive", ["clamp", "scoop"])
def test_what_must_be_held_in_the_air_is_held_at_its_place(analyse, primitive):
    """It passes over what is on its way, comes down to its place, and is not let go there."""
    goal = "{bodies: [cube], place: [0.5, 0.6, 0.06], held: true}"
    analysis = analyse(CUP, goal)
    rng = np.random.default_rng(0)
    ends = []
    for _ in range(PLANS):
        (subgoal,) = analysis.draw_subgoals(rng)
        head = draw_clamp(subgoal, rng)
        while primitive == "scoop" and head.primitive != "scoop":
            head = draw_head(subgoal, rng, 1.0)

        path = HeadPath()
        PRIMITIVES[primitive](path, subgoal, head, rng)
        heights = [pose.position[2] for pose in path.poses[path._held_from :]]
        ends.append(heights[-1] - heights[0])
        assert max(heights) - heights[0] > RIM_M - 0.001
        assert np.allclose(path.poses[-1].rpy[:2], 0)
        assert path.grips[-1] == (primitive == "clamp")

    assert np.median(ends) == pytest.approx(0.045, abs=0.01)


def test_pads_of_any_origin_are_known_for_pads(analyse):
    analysis = analyse(CUP, "{bodies: [cube], raised: 0.1, held: true}")
    rng = np.random.default_rng(0)
    subgoal, head, _ = clamp(analysis, rng)
    tool = build_clamp(head, Pose(np.array([0.1, 0.0, -0.3])), 0.012)
    guessed = guess_head(tool, subgoal, rng)
    assert guessed.head.primitive == "clamp"
    assert guessed.head.width == pytest.approx(head.width)


@pytest.mark.parametrize(
    ("apart", "least", "most"), [("0.3", 0.3, 0.4), ("'< 0.1'", 0.06, 0.1)]
)
def test_bodies_get_apart_or_together_from_the_first_one(analyse, apart, least, most):
    analysis = analyse(TRAY, f'{{bodies: ["cube_*"], apart: {apart}}}')
    (subgoal,) = analysis.draw_subgoals(np.random.default_rng(0))
    (solid,) = subgoal.solids
    first = analysis.model.solids["cube_0"].position
    assert solid.body.name == "cube_1"
    assert least < np.linalg.norm(solid.position + subgoal.shift - first) < most


@pytest.mark.parametrize("released", ["true", "false"])
def test_a_hook_backs_off_from_what_it_must_let_go(ask, released):
    goal = f'{{bodies: [parcel], place: ["< 0.5", null, null], released: {released}}}'
    brief = ask(SHELF, goal, gripper=False)
    rng = np.random.default_rng(0)
    (subgoal,) = SceneAnalysis(brief).draw_subgoals(rng)
    heads = [draw_head(subgoal, rng, 1.0) for _ in range(PLANS)]
    hook = next(head for head in heads if head.kind == "hook")
    path = HeadPath()
    PRIMITIVES["hook"](path, subgoal, hook, rng)
    before, end = (pose.position for pose in path.poses[-2:])
    assert (end[0] > before[0] + 0.02) == (released == "true")


def test_of_goals_that_must_all_be_reached_one_that_is_met_is_left_out(analyse):
    met = "{bodies: [cube], place: [null, 0, null], tolerance: 0.05}"
    wanted = "{bodies: [cube], moved: [-0.2, null, null]}"
    analysis = analyse(CUP, f"{met}\n  - {wanted}\nevery: true")
    (subgoal,) = analysis.draw_subgoals(np.random.default_rng(0))
    assert subgoal.shift[0] < -0.15


BOARD_M = 0.02
SCRAPS = f"""
  - {{name: board, box: [0.2, 0.3, {BOARD_M}], position: [0.6, 0, {BOARD_M / 2}], fixed: true}}
  - {{name: jar, cylinder: {{radius: 0.03, length: 0.1}}, position: [0.6, 0.12, 0.0701], mass: 0.2}}
  - name: scrap
    box: [0.02, 0.02, 0.004]
    position: [0.54, -0.06, 0.0221]
    mass: 0.001
    repeat: {{grid: [3, 3, 1], spacing: 0.04}}
"""
PILE = """
  - {name: lower, box: [0.1, 0.03, 0.02], position: [0.6, 0, 0.11], mass: 0.03}
  - {name: upper, box: [0.1, 0.1, 0.02], position: [0.6, 0, 0.1301], mass: 0.1}
  - {name: stand, box: [0.12, 0.12, 0.1], position: [0.6, 0, 0.05], fixed: true}
"""
PLUG = """
  - name: wall
    fixed: true
    position: [0.7, 0, 0]
    parts:
      - {box: [0.06, 0.3, 0.13], position: [0, 0, 0.065]}
      - {box: [0.06, 0.3, 0.1], position: [0, 0, 0.212]}
      - {box: [0.06, 0.134, 0.032], position: [0, 0.083, 0.146]}
      - {box: [0.06, 0.134, 0.032], position: [0, -0.083, 0.146]}
  - name: plug
    position: [0.69, 0, 0.1455]
    mass: 0.05
    parts:
      - {box: [0.08, 0.03, 0.03]}
      - {box: [0.02, 0.06, 0.06], position: [-0.05, 0, 0]}
"""


def test_what_must_get_lower_is_pushed_over_an_edge_that_is_free(analyse):
    goal = '{bodies: ["scrap_*"], place: [null, null, "< 0.01"]}'
    analysis = analyse(SCRAPS, goal, gripper=False)
    rng = np.random.default_rng(0)
    lefts = 0
    for _ in range(PLANS):
        for subgoal in analysis.draw_subgoals(rng):
            assert subgoal.falls
            ends = subgoal.points[:, :2] + subgoal.shift[:2] - [0.6, 0]
            assert (np.abs(ends) > [0.1, 0.15]).all(axis=0).any()
            lefts += subgoal.shift[1] > 0.1  # where the jar is

            path = HeadPath()
            head = draw_head(subgoal, rng, 1.0)
            if head.primitive == "push":
                PRIMITIVES["push"](path, subgoal, head, rng)
                lowest = min(pose.position[2] for pose in path.poses)
                assert lowest < BOARD_M + 0.004

    assert lefts < PLANS / 10


def test_what_may_fall_over_where_it_stands_is_led_to_no_edge(analyse):
    analysis = analyse(POST, '{bodies: [post], place: [null, null, "< 0.1"]}')
    (subgoal,) = analysis.draw_subgoals(np.random.default_rng(0))
    assert not subgoal.falls or subgoal.length < 0.01


@pytest.mark.parametrize(
    ("bodies", "name", "way", "kind"),
    [(PILE, "lower", '"> 0.1"', "rod"), (PLUG, "plug", '"< -0.1"', "hook")],
)
def test_what_is_kept_down_and_gets_out_straight_gets_a_rod_or_a_hook(
    ask, bodies, name, way, kind
):
    brief = ask(bodies, f"{{bodies: [{name}], moved: [{way}, null, null]}}", False)
    (subgoal,) = SceneAnalysis(brief).draw_subgoals(np.random.default_rng(0))
    assert subgoal.slides_out

    rng = np.random.default_rng(0)
    heads = [make_straight_mover(subgoal, rng) for _ in range(10)]
    lengths = [head.pieces[0].size[0] for head in heads if head.kind == kind]
    assert lengths
    if kind == "rod":  # it follows the body through what is around it
        assert min(lengths) > 0.1


def test_what_can_be_lifted_needs_neither(analyse):
    analysis = analyse(CUP, "{bodies: [cube], at: cup, place: [0.2, 0, null]}")
    (subgoal,) = analysis.draw_subgoals(np.random.default_rng(0))
    assert not subgoal.slides_out
