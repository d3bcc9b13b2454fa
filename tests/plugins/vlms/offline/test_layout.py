"""Where the arm works, what is below it, and which design has the lesser faults."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from core.geometry import Pose
from core.interfaces import PAPER
from plugins.vlms.offline.faults import Faults, find_places
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.making import change_shaft, make
from plugins.vlms.offline.reach import measure_reach
from plugins.vlms.offline.search import Search
from tests.plugins.vlms.offline.trying import make_brief, read_task
from tests.support.errands import CUBE, NEARER

TALL = """
  - {name: tower, box: [0.1, 0.1, 0.4], position: [-0.5, 0, 0.2], fixed: true}
"""


@pytest.mark.parametrize("rpy", [(0, 0, 0), (np.pi, 0, 0), (0, np.pi / 2, 0.3)])
def test_reach_turns_with_the_base(tmp_path, rpy):
    robot = read_task(tmp_path, CUBE, NEARER).robot
    upright = measure_reach(replace(robot, base=Pose()))
    base = Pose.xyz_rpy((0.2, -0.1, 0.5), rpy)
    turned = measure_reach(replace(robot, base=base))
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (20, 1, 3))
    expected = upright.excess(points)
    assert expected.min() < expected.max()
    assert turned.excess(base.apply(points)) == pytest.approx(expected, abs=1e-6)


def test_what_is_too_near_is_not_too_far(tmp_path):
    reach = measure_reach(read_task(tmp_path, CUBE, NEARER).robot)
    for x, near, far in ((0.05, True, False), (0.5, False, False), (1.5, False, True)):
        point = reach.base.apply([x, 0, 0.3])
        assert (reach.too_near(point) > 0) == near
        assert (reach.too_far(point) > 0) == far


def test_the_ground_is_below_home_alone(tmp_path):
    """A tower behind the robot makes no shaft shorter."""
    drops = []
    for bodies in (CUBE, CUBE + TALL):
        search = Search(make_brief(read_task(tmp_path, bodies, NEARER)))
        lowest = min(search.invent().recipe.mount.z for _ in range(10))
        drops.append(lowest)
    assert drops[0] == pytest.approx(drops[1], abs=0.1)


def test_tops_above_a_height_do_not_count(tmp_path):
    layout = Layout(read_task(tmp_path, CUBE + TALL, NEARER), 0, PAPER)
    everywhere = (np.full(2, -1.0), np.full(2, 1.0))
    assert layout.top_at(*everywhere) == pytest.approx(0.4)
    assert layout.top_at(*everywhere, below=0.39) == pytest.approx(0.06)


def test_what_rolls_loads_a_tool_by_its_whole_weight(tmp_path):
    loads = []
    for more in ("", "rolling_friction: 0.001, "):
        bodies = CUBE.replace("mass: 0.2", f"{more}mass: 2.0")
        brief = make_brief(read_task(tmp_path, bodies, NEARER))
        loads.append(Search(brief).options[0].load)
    assert loads == pytest.approx([9.81, 19.62], rel=1e-3)


def test_a_plan_leads_the_head_through_the_steps_of_its_way(tmp_path):
    made = Search(make_brief(read_task(tmp_path, CUBE, NEARER))).invent()
    frame = made.option.jobs[0].frame
    for row, waypoint in list(zip(made.rows, made.waypoints, strict=True))[-3:]:
        head = Pose.xyz_rpy(row[:3], row[3:6]) @ made.mount
        there = frame @ waypoint.step.pose
        assert head.position == pytest.approx(there.position, abs=1e-9)
        assert head.rotation_matrix == pytest.approx(there.rotation_matrix, abs=1e-9)


def test_places_begin_at_home_and_end_at_the_last_waypoint(tmp_path):
    search = Search(make_brief(read_task(tmp_path, CUBE, NEARER)))
    made = search.invent()
    places = find_places(made, search.layout)
    home = search.layout.home
    assert places.positions[0] == pytest.approx(home.position)
    assert places.turns[0] == pytest.approx(home.rotation_matrix, abs=1e-9)
    last = Pose.xyz_rpy(made.rows[-1, :3], made.rows[-1, 3:6])
    assert places.positions[-1] == pytest.approx(last.position)
    assert places.turns[-1] == pytest.approx(last.rotation_matrix, abs=1e-9)
    assert np.linalg.norm(np.diff(places.positions, axis=0), axis=1).max() <= 0.04


def test_another_shaft_is_as_if_it_had_been_made_with_it(tmp_path):
    made = Search(make_brief(read_task(tmp_path, CUBE, NEARER))).invent()
    other = change_shaft(made, "bridge")
    again = make(made.option, other.recipe)
    assert other.tool == again.tool
    assert "bridge" in other.tool.name
    assert other.rows == pytest.approx(again.rows)


def test_faults_are_ordered_by_the_worst():
    ordered = [
        Faults(),
        Faults(hits=2),
        Faults(unreached=0.1),
        Faults(unreached=0.1, hits=1),
        Faults(unreached=0.6),
        Faults(refused=True),
    ]
    for lesser, greater in pairwise(ordered):
        assert lesser < greater
