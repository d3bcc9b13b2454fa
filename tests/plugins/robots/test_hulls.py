import re

import numpy as np
import pytest
import trimesh

from core.errors import UserError
from core.imports.meshes import MAX_CORNERS
from core.support.sandbox import isolated
from plugins.robots import hulls
from plugins.robots.hulls import Job
from tests.plugins.tasks.file.imports.conftest import called
from tests.support.text import replaced_all


def hull_file(mesh, scale=(1.0, 1.0, 1.0)):
    return Job(str(mesh), scale).make()


def visual_file(mesh, color):
    return Job(str(mesh), color=color).make()


RED = (0.8, 0.1, 0.1, 1.0)
GREY = (0.5, 0.5, 0.5, 1.0)


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(hulls, "isolated", called)
    return tmp_path / "cache"


@pytest.fixture
def write(tmp_path):
    def write(name, mesh=None, **options):
        mesh = mesh if mesh is not None else trimesh.creation.box((0.1, 0.2, 0.3))
        kind = {"ascii.stl": "stl_ascii"}.get(name, name.rpartition(".")[2])
        data = mesh.export(file_type=kind, **options)
        (tmp_path / name).write_bytes(
            data if isinstance(data, bytes) else data.encode()
        )
        return tmp_path / name

    return write


@pytest.mark.parametrize(
    "name",
    ["a.stl", "ascii.stl", "A.STL", "a.obj", "a.dae", "a.ply", "a.glb"],
)
def test_each_kind_of_file_has_the_same_hull(write, name):
    hull = trimesh.load_mesh(
        hull_file(write(name.lower()).rename(write(name.lower()).with_name(name)))
    )
    np.testing.assert_allclose(hull.extents, (0.1, 0.2, 0.3), atol=1e-6)
    assert len(hull.vertices) == 8
    assert hull.is_watertight


def test_scale_and_the_unit_of_collada_count(write):
    scaled = hull_file(write("a.stl"), (1.0, -2.0, 0.5))
    np.testing.assert_allclose(
        trimesh.load_mesh(scaled).extents, (0.1, 0.4, 0.15), atol=1e-6
    )
    assert trimesh.load_mesh(scaled).volume > 0
    file = write("a.dae")
    file.write_text(
        replaced_all(
            file.read_text(),
            ("<up_axis>", '<unit name="centimeter" meter="0.01"/><up_axis>'),
        )
    )
    np.testing.assert_allclose(
        trimesh.load_mesh(hull_file(file)).extents, (0.001, 0.002, 0.003), atol=1e-6
    )


@pytest.mark.thorough
def test_a_hull_has_few_corners_and_is_near_the_whole(write):
    file = write("ball.stl", trimesh.creation.icosphere(subdivisions=5, radius=0.1))
    hull = trimesh.load_mesh(hull_file(file))
    assert len(hull.vertices) == MAX_CORNERS
    assert len(hull.faces) <= 255
    assert hull.volume > 0.94 * 4 / 3 * np.pi * 0.1**3
    rim = write(
        "disc.stl", trimesh.creation.cylinder(radius=0.1, height=0.001, sections=2000)
    )
    assert trimesh.load_mesh(hull_file(rim)).volume > 0.99 * np.pi * 0.1**2 * 0.001


def test_names_tell_content_apart(write, tmp_path):
    one = write("a.stl")
    same = write("b.stl")
    other = write("c.stl", trimesh.creation.box((1, 1, 1)))
    assert hull_file(one) == hull_file(same)
    assert (
        len(
            {
                hull_file(one),
                hull_file(other),
                hull_file(one, (2.0, 1.0, 1.0)),
                visual_file(one, GREY),
            }
        )
        == 4
    )
    made = hull_file(one).stat().st_mtime_ns
    assert hull_file(one).stat().st_mtime_ns == made
    hull_file(one).write_bytes(b"")
    assert trimesh.load_mesh(hull_file(one)).volume > 0


def test_what_is_drawn_keeps_its_colours(write, tmp_path):
    assert drawn(visual_file(write("a.stl"), RED)) == [RED]
    painted = trimesh.creation.box((0.1, 0.1, 0.1))
    painted.visual.face_colors = [0, 255, 0, 255]
    assert drawn(visual_file(write("a.ply", painted), RED)) == [(0.0, 1.0, 0.0, 1.0)]
    (tmp_path / "b.mtl").write_text("newmtl blue\nKd 0 0 1\n")
    file = write("b.obj")
    file.write_text("mtllib b.mtl\nusemtl blue\n" + file.read_text())
    assert drawn(visual_file(file, RED)) == [(0.0, 0.0, 1.0, 1.0)]


def drawn(file):
    assert b"Z_UP" in file.read_bytes()
    colors = [
        part.visual.material.main_color / 255
        for part in trimesh.load_scene(file).dump()
    ]
    return [tuple(np.round(color, 2).tolist()) for color in colors]


BAD = {
    "none.stl": (None, "none.stl can't be read: No such file"),
    "a.step": (
        b"ISO-10303-21;",
        r"a.step is of no kind that is read: .stl, .obj",
    ),
    "cut.stl": (
        b"\0" * 80 + b"\xff\xff\xff\xff",
        "cut.stl (can't be read|has no triangles)",
    ),
    "empty.obj": (b"", "empty.obj (can't be read|has no triangles)"),
    "text.dae": (b"<COLLADA", "text.dae can't be read"),
    "points.obj": (
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\n",
        "points.obj (can't be read|has no triangles)",
    ),
    "flat.obj": (
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n",
        "flat.obj is flat; a collision shape",
    ),
    "nan.obj": (
        b"v 0 0 inf\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 2 3 4\n",
        "nan.obj has a corner that is not",
    ),
    "mm.obj": (
        b"v 0 0 0\nv 90 0 0\nv 0 9 0\nv 0 0 9\nf 1 2 3\nf 2 3 4\n",
        "mm.obj is 90 m large; .*0.001 0.001",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_mesh_is_named_in_one_line(name, tmp_path):
    content, message = BAD[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(UserError, match=message) as caught:
        hull_file(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_a_mesh_that_is_too_large_is_not_read(write, monkeypatch):
    monkeypatch.setattr(hulls, "MAX_MB", 0.0001)
    with pytest.raises(
        UserError, match=r"a.stl has 0.0 MB; at most .* fewer triangles"
    ):
        hull_file(write("a.stl"))


def test_a_cache_that_cant_be_written_is_named(write, cache):
    cache.write_text("a file")
    with pytest.raises(
        UserError, match=r"meshes can't be kept in .*cache.*; make the folder writable"
    ):
        hull_file(write("a.stl"))


@pytest.mark.thorough
def test_doubled_nodes_of_collada_end_with_their_process(write, monkeypatch):
    """Each of 40 nodes holds the one before it twice: 5 kB that unfold to 1e12 shapes."""
    monkeypatch.setattr(hulls, "isolated", isolated)
    monkeypatch.setattr(hulls, "LIMIT_S", 5)
    file = write("a.dae")
    text = file.read_text()
    first = re.search(r"<node .*?</node>", text, re.DOTALL)
    node = re.sub('id="[^"]*"', 'id="n0"', first[0], count=1)
    nodes = [
        f'<node id="n{n}">{f"""<instance_node url="#n{n - 1}"/>""" * 2}</node>'
        for n in range(1, 41)
    ]
    library = f"<library_nodes>{node}{''.join(nodes)}</library_nodes>"
    text = text.replace(first[0], '<node id="top"><instance_node url="#n40"/></node>')
    file.write_text(
        replaced_all(
            text, ("<library_visual_scenes>", f"{library}<library_visual_scenes>")
        )
    )
    with pytest.raises(
        UserError,
        match=r"mesh .*a.dae (takes more than 5 s|can't be read|needs too much memory)",
    ):
        hull_file(file)


def test_a_mesh_that_is_large_and_fine_is_drawn_coarsely():
    fine = trimesh.creation.icosphere(subdivisions=7, radius=2.0)
    assert len(fine.faces) > hulls.MAX_DRAWN
    coarse = hulls._coarsen(fine)
    assert 10_000 < len(coarse.faces) <= hulls.MAX_DRAWN
    assert np.allclose(coarse.extents, fine.extents, atol=0.05)
