"""Where the arm works, what is below it, and which design has the lesser faults."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from core.geometry import Pose
from core.interfaces import PAPER
from plugins.vlms.offline.faults import Faults
from plugins.vlms.offline.layout import Layout
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
