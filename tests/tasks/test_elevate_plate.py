from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from tasks.elevate_plate import FOOT_HEIGHT, FOOT_RADIUS, LIFT, RIM_RADIUS, RIM_TOP, START, ElevatePlate

TASK = ElevatePlate()
STATE = TASK.scene(0).state()


def at(*position):
    return replace(STATE, positions=np.array([position]))


def test_reward_rises_in_step_with_the_plate_lifted():
    lifted = [at(START[0], START[1], START[2] + LIFT * share) for share in np.linspace(0, 1, 11)]
    rewards = np.array([TASK.reward(STATE, end) for end in lifted])
    assert rewards == pytest.approx(np.linspace(0, 1, 11))
    assert TASK.reward(State.stack([STATE] * 11), State.stack(lifted)) == pytest.approx(rewards)


@pytest.mark.parametrize(
    "position",
    [
        (START[0] - 0.3, 0.0, 0.0),  # pulled along the table
        (START[0], LIFT, LIFT),  # lifted, and as far to the side
        (1.5, 0.0, -0.6),  # off the table
        (START[0], 0.0, 2 * LIFT),  # thrown up
    ],
)
def test_a_plate_elsewhere_earns_nothing(position):
    assert TASK.reward(STATE, at(*position)) == pytest.approx(0.0, abs=1e-9)


def test_reward_counts_from_where_the_plate_settled():
    settled = at(START[0], 0.01, 0.001)
    assert TASK.reward(settled, settled) == 0.0
    assert TASK.reward(settled, at(START[0], 0.01, LIFT + 0.001)) == pytest.approx(1.0)


def heights(mesh, x, y):
    """The heights at which a vertical line through (x, y) crosses the mesh's faces."""
    corner, side, other = (mesh.triangles[:, i] - (mesh.triangles[:, 0] if i else 0.0) for i in range(3))
    area = side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0]
    upright = np.abs(area) < 1e-12
    area[upright] = np.inf
    dx, dy = x - corner[:, 0], y - corner[:, 1]
    u, v = (dx * other[:, 1] - dy * other[:, 0]) / area, (side[:, 0] * dy - side[:, 1] * dx) / area
    hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & ~upright
    return (corner[:, 2] + u * side[:, 2] + v * other[:, 2])[hit]


def test_the_plates_collision_shapes_match_its_visual_shape():
    """Upper and lower faces are equal along a few radial lines outside the foot."""
    body = TASK.scene(0)["plate"]
    visual = [body.visuals[0].shape.to_trimesh()]
    collision = [part.shape.to_trimesh().convex_hull.apply_transform(part.pose.matrix) for part in body.collisions]
    for angle in np.radians([1.0, 8.0, 40.0, 91.0]):
        for radius in np.linspace(FOOT_RADIUS + 0.003, RIM_RADIUS - 0.006, 12):
            x, y = radius * np.cos(angle), radius * np.sin(angle)
            shown, solid = (np.concatenate([heights(mesh, x, y) for mesh in meshes]) for meshes in (visual, collision))
            assert solid.max() == pytest.approx(shown.max(), abs=0.002)
            assert solid.min() == pytest.approx(shown.min(), abs=0.002)
            assert shown.min() > FOOT_HEIGHT - 1e-6  # the gap beyond the foot
    assert visual[0].bounds[:, 2] == pytest.approx([0.0, RIM_TOP])
