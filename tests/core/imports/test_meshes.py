"""Mesh files of the usual kinds, and their hulls."""

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import QhullError

from core.errors import UserError
from core.imports.meshes import (
    KINDS,
    MAX_CORNERS,
    check_size,
    find_color,
    hull_corners,
    kind_of,
    load_parts,
    used_corners,
    whole_content,
)

BOX = trimesh.creation.box((0.1, 0.2, 0.3))


KINDS_WRITTEN = [kind[1:] for kind in KINDS]


def parts_of(file, mesh, kind):
    data = mesh.export(file_type=kind)
    content = data if isinstance(data, bytes) else data.encode()
    return load_parts(content, file / f"a.{kind}")


@pytest.mark.parametrize("kind", KINDS_WRITTEN)
def test_the_parts_of_a_file_have_triangles(tmp_path, kind):
    large = 1000.0 if kind == "3mf" else 1.0  # its unit is the millimetre
    (part,) = parts_of(tmp_path, BOX.copy().apply_scale(large), kind)
    assert np.ptp(used_corners(part), axis=0) == pytest.approx((0.1, 0.2, 0.3))


def test_a_colour_is_that_of_the_part_or_none(tmp_path):
    painted = BOX.copy()
    painted.visual.face_colors = (255, 0, 51, 255)
    (part,) = parts_of(tmp_path, painted, "ply")
    assert find_color(part) == pytest.approx((1, 0, 0.2, 1))
    (bare,) = parts_of(tmp_path, BOX, "stl")
    assert find_color(bare) is None


def test_groups_and_materials_of_an_obj_are_parts(tmp_path):
    """The materials are read that lie beside it, and no others; what they say belongs to its content."""
    (tmp_path / "in").mkdir()
    file = tmp_path / "in" / "a.obj"
    text = BOX.export(file_type="obj")
    first, *faces = re.findall(r"^f .*$", text, re.MULTILINE)
    grouped = f"usemtl blue\n{first}\ng two\n" + "\n".join(faces)
    corners = text[: text.index(first)]
    red = "newmtl blue\nKd 0 0 1\n"
    for folder, named, color in (
        ("in", "b.mtl", (0, 0, 1, 1)),
        (".", "../b.mtl", None),
    ):
        place = tmp_path / folder / "b.mtl"
        place.write_text(red)
        data = f"mtllib {named}\n{corners}{grouped}".encode()
        parts = load_parts(data, file)
        assert sorted(len(part.faces) for part in parts) == [1, 11]
        assert {find_color(part) for part in parts} == {color}
        assert (whole_content(file, data) != data) == (color is not None)
        place.unlink()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (b"v 0 0 0\nv 1 0 0\n", "no triangles|can't be read as OBJ"),
        (b"v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", "not a finite number"),
        (b"v 0 0 0\nv 1 0 0\nv 0 1e20 0\nf 1 2 3\n", "not a finite number of usual"),
    ],
)
def test_what_is_no_mesh_is_refused(tmp_path, text, why):
    with pytest.raises(UserError, match=why):
        load_parts(text, tmp_path / "a.obj")


def test_sizes_and_kinds_that_are_not_meant_are_refused():
    with pytest.raises(UserError, match=r"is 90 m large; .*0.001"):
        check_size(90.0)
    with pytest.raises(UserError, match="only 1e-06 m large"):
        check_size(1e-6)
    with pytest.raises(UserError, match=r"no kind that is read: .stl, .obj"):
        kind_of(Path("a.step"))


def test_a_hull_keeps_the_corners_that_stick_out():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.1).vertices
    spike = np.vstack([ball, [[0.3, 0, 0], [0.01, 0, 0]]])
    kept = hull_corners(spike)
    assert len(kept) == MAX_CORNERS
    assert [0.3, 0, 0] in kept.tolist()
    assert [0.01, 0, 0] not in kept.tolist()
    with pytest.raises(QhullError):
        hull_corners(ball * [1, 1, 0])
