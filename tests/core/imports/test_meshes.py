"""Mesh files of the usual kinds, and their hulls."""

import io

import numpy as np
import pytest
import trimesh
from scipy.spatial import QhullError

from core.errors import UserError
from core.imports.meshes import (
    MAX_CORNERS,
    find_color,
    hull_corners,
    load_parts,
    used_corners,
)

BOX = trimesh.creation.box((0.1, 0.2, 0.3))


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "glb"])
def test_the_parts_of_a_file_have_triangles(kind):
    data = BOX.export(file_type=kind)
    content = data if isinstance(data, bytes) else data.encode()
    ((part,), _) = load_parts(io.BytesIO(content), kind, {})
    assert np.ptp(used_corners(part), axis=0) == pytest.approx((0.1, 0.2, 0.3))


def test_a_colour_is_that_of_the_part_or_none():
    painted = BOX.copy()
    painted.visual.face_colors = (255, 0, 51, 255)
    ((part,), _) = load_parts(io.BytesIO(painted.export(file_type="ply")), "ply", {})
    assert find_color(part) == pytest.approx((1, 0, 0.2, 1))
    ((bare,), _) = load_parts(io.BytesIO(BOX.export(file_type="stl")), "stl", {})
    assert find_color(bare) is None


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"v 0 0 0\nv 1 0 0\n", "no triangles|can't be read as OBJ"),
        (b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "not a finite number"),
    ],
)
def test_what_is_no_mesh_is_refused(text, why):
    with pytest.raises(UserError, match=why):
        load_parts(io.BytesIO(text), "obj", {"process": False})


def test_a_hull_keeps_the_corners_that_stick_out():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1).vertices
    spike = np.vstack([ball, [[0.3, 0, 0], [0.01, 0, 0]]])
    kept = hull_corners(spike)
    assert len(kept) == MAX_CORNERS
    assert [0.3, 0, 0] in kept.tolist()
    assert [0.01, 0, 0] not in kept.tolist()
    with pytest.raises(QhullError):
        hull_corners(ball * [1, 1, 0])
