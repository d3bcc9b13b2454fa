"""An agent looks at a trial from where it wants, and close to a body."""

from dataclasses import replace

import numpy as np
import pytest

from core.plugins import installed
from plugins.agents.arguments import Watch
from plugins.agents.bench import Refused
from plugins.agents.viewing import find_aim


@pytest.fixture(scope="module")
def task():
    return installed().factory("task", "BringCube")()


def aim(task, **asked):
    scene = task.scene(0)
    found = find_aim(Watch(candidate="a", **asked), scene, task.camera)
    return found and found(task.camera, scene.state())


def test_the_usual_camera_stays_where_nothing_is_asked(task):
    assert aim(task) is None


def test_a_camera_stands_where_it_is_asked(task):
    camera = aim(task, position=[1.0, 0.5, 0.4], fov_deg=20.0)
    assert camera.position == (1.0, 0.5, 0.4)
    assert camera.target == tuple(task.camera.target)
    assert camera.fov_deg == 20.0


def test_a_body_is_followed_from_near(task):
    scene = task.scene(0)
    state = scene.state()
    follow = find_aim(Watch(candidate="a", body="cube"), scene, task.camera)
    first = follow(task.camera, state)
    assert np.allclose(first.target, scene["cube"].pose.position)
    assert first.fov_deg < task.camera.fov_deg / 2

    cube = state.names.index("cube")
    positions = state.positions.copy()
    positions[cube] += [0.1, 0.0, 0.2]
    second = follow(task.camera, replace(state, positions=positions))
    assert np.allclose(np.subtract(second.target, first.target), [0.1, 0.0, 0.2])
    away = np.linalg.norm(np.subtract(second.position, second.target))
    assert np.isclose(2 * away * np.tan(np.radians(second.fov_deg) / 2), 0.3)


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        ({"body": "cub"}, "did you mean 'cube'"),
        ({"body": "cube", "target": [0, 0, 0]}, "give target or body"),
        ({"position": [0, 0, 1], "target": [0, 0, 1]}, "are the same place"),
    ],
)
def test_what_can_not_be_looked_at_is_refused(task, asked, reason):
    with pytest.raises(Refused, match=reason):
        aim(task, **asked)
