"""Tubes, cups and mugs of a scene file: hollow, of convex parts, and as heavy as round ones."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from plugins.tasks.file.task import FileTask

SCENE = """name: Vessel
description: A vessel stands on the table. Bring it to the mark.
bodies:
  - {name: vessel, %s, position: [0.6, 0, 0.05], %s}
goals:
  - {bodies: [vessel], place: [0.5, 0, null]}
"""


def vessel(folder, shape, more="density: 1000"):
    (folder / "scene.yaml").write_text(SCENE % (shape, more))
    return FileTask(str(folder / "scene.yaml")).scene(0)["vessel"]


def is_solid_at(body, point):
    """Check if one of the collision shapes holds a point of the body's frame."""
    for geom in body.collisions:
        within = geom.pose.inverse().apply([point])
        hull = ConvexHull(geom.shape.to_trimesh().vertices)
        if (within @ hull.equations[:, :3].T + hull.equations[:, 3] <= 0).all():
            return True
    return False


WALL = np.pi * (0.04**2 - 0.036**2)


@pytest.mark.parametrize(
    ("shape", "volume", "has_floor"),
    [
        ("tube: {radius: 0.04, length: 0.1, wall: 0.004}", WALL * 0.1, False),
        (
            "cup: {radius: 0.04, length: 0.1, wall: 0.004}",
            WALL * 0.096 + np.pi * 0.04**2 * 0.004,
            True,
        ),
        (
            "cup: {radius: 0.04, length: 0.1, wall: 0.004, floor: 0.01}",
            WALL * 0.09 + np.pi * 0.04**2 * 0.01,
            True,
        ),
    ],
)
def test_a_vessel_is_hollow_and_weighs_what_a_round_one_does(
    tmp_path, shape, volume, has_floor
):
    body = vessel(tmp_path, shape)
    assert body.mass == pytest.approx(1000 * volume, rel=1e-6)
    assert not is_solid_at(body, [0, 0, 0])
    assert not is_solid_at(body, [0.034, 0, 0.049])
    assert is_solid_at(body, [0, 0, -0.049]) == has_floor
    for angle in np.linspace(0, 6, 50):
        way = np.array([np.cos(angle), np.sin(angle), 0])
        assert is_solid_at(body, 0.038 * way + [0, 0, 0.04])
        assert not is_solid_at(body, 0.041 * way)


def test_a_mug_has_a_handle_that_a_hook_fits_into(tmp_path):
    body = vessel(
        tmp_path, "mug: {radius: 0.04, length: 0.1, wall: 0.004, handle: 0.035}"
    )
    assert is_solid_at(body, [0.072, 0, 0])
    assert is_solid_at(body, [0.05, 0, 0.03])
    assert not is_solid_at(body, [0.055, 0, 0])
    assert not is_solid_at(body, [0.077, 0, 0])
    assert not is_solid_at(body, [-0.05, 0, 0])
    cup = vessel(tmp_path, "cup: {radius: 0.04, length: 0.1, wall: 0.004}")
    assert cup.mass < body.mass < 1.3 * cup.mass


def test_vessels_are_parts_of_bodies_too(tmp_path):
    """A cup on a plate, turned upside down."""
    cup = "cup: {radius: 0.03, length: 0.06, wall: 0.003}"
    turned = "position: [0, 0, 0.035], rpy_deg: [180, 0, 0], color: red"
    parts = f"parts: [{{box: [0.2, 0.2, 0.01]}}, {{{cup}, {turned}}}]"
    body = vessel(tmp_path, parts, "mass: 0.2")
    assert body.mass == 0.2
    assert is_solid_at(body, [0, 0, 0.0645])
    assert not is_solid_at(body, [0, 0, 0.03])
    assert {geom.color[:3] for geom in body.visuals[1:]} == {(1, 0, 0)}
