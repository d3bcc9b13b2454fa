"""The shapes of ElevatePlate's plate; its reward is in `tests/tasks/test_lifting.py`."""

import numpy as np
import pytest

from tasks.elevate_plate import FOOT_HEIGHT, FOOT_RADIUS, RIM_RADIUS, RIM_TOP, ElevatePlate


def heights(mesh, x, y):
    """The heights at which a vertical line through (x, y) crosses the mesh's faces."""
    corner, side, other = (mesh.triangles[:, i] - (mesh.triangles[:, 0] if i else 0.0) for i in range(3))
    area = side[:, 0] * other[:, 1] - side[:, 1] * other[:, 0]
    upright = np.abs(area) < 1e-12
    area[upright] = np.inf
    dx = x - corner[:, 0]
    dy = y - corner[:, 1]
    u = (dx * other[:, 1] - dy * other[:, 0]) / area
    v = (side[:, 0] * dy - side[:, 1] * dx) / area
    hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & ~upright
    return (corner[:, 2] + u * side[:, 2] + v * other[:, 2])[hit]


def test_the_plates_collision_shapes_match_its_visual_shape():
    """Upper and lower faces are equal along a few radial lines outside the foot."""
    body = ElevatePlate().scene(0)["plate"]
    visual = [body.visuals[0].shape.to_trimesh()]
    collision = [part.shape.to_trimesh().convex_hull.apply_transform(part.pose.matrix) for part in body.collisions]
    for angle in np.radians([1.0, 8.0, 40.0, 91.0]):
        for radius in np.linspace(FOOT_RADIUS + 0.003, RIM_RADIUS - 0.006, 12):
            x = radius * np.cos(angle)
            y = radius * np.sin(angle)
            shown, solid = (np.concatenate([heights(mesh, x, y) for mesh in meshes]) for meshes in (visual, collision))
            assert solid.max() == pytest.approx(shown.max(), abs=0.002)
            assert solid.min() == pytest.approx(shown.min(), abs=0.002)
            assert shown.min() > FOOT_HEIGHT - 1e-6  # the gap beyond the foot
    assert visual[0].bounds[:, 2] == pytest.approx([0.0, RIM_TOP])
