import itertools
import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import UserError
from core.support.sandbox import TooSlowError
from plugins.tasks.file.imports import convex, read_mesh, solids
from tests.plugins.tasks.file.imports.conftest import called


def step():
    """Two boxes in the shape of an L, joined to one closed mesh."""
    return trimesh.creation.extrude_triangulation(
        [[0, 0], [0.2, 0], [0.2, 0.1], [0.1, 0.1], [0.1, 0.2], [0, 0.2]],
        [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]],
        0.1,
    )


def total(body):
    return sum(part.shape.volume for part in body.collisions)


@pytest.mark.parametrize("kind", ["obj", "stl", "glb", "ply", "dae"])
def test_a_convex_mesh_is_one_part_with_its_mass_and_size(tmp_path, kind):
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    box.apply_translation([0.5, 0.1, 0.2])
    box.export(tmp_path / f"box.{kind}")
    made = read_mesh(tmp_path / f"box.{kind}", 0.5)
    (body,) = made.bodies
    assert len(body.collisions) == 1
    assert body.mass == pytest.approx(0.006 / 8, rel=1e-6)
    middle, size = body.collisions[0].shape.bounds
    expected = [[0.25, 0.05, 0.1], [0.05, 0.1, 0.15]]
    if kind == "glb":  # y points up
        expected = [[0.25, -0.1, 0.05], [0.05, 0.15, 0.1]]
    np.testing.assert_allclose([middle, size], expected, atol=1e-6)
    assert total(body) == pytest.approx(0.006 / 8, rel=1e-6), "faces look outward"
    assert any("z is up" in note for note in made.notes) == (kind == "glb")


def test_parts_of_a_glb_keep_their_colours(tmp_path):
    scene = trimesh.Scene()
    for number, color in enumerate([[255, 0, 0, 255], [0, 0, 255, 255]]):
        box = trimesh.creation.box((0.1, 0.1, 0.1))
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=color)
        box.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(
            box, transform=trimesh.transformations.translation_matrix([number, 0, 0])
        )
    (tmp_path / "two.glb").write_bytes(scene.export(file_type="glb"))
    body = read_mesh(tmp_path / "two.glb").bodies[0]
    assert {geom.color for geom in body.visuals} == {(1, 0, 0, 1), (0, 0, 1, 1)}
    assert len(body.collisions) == 2, "pieces that are convex need no cutting"


def wedge(first, second, inner, outer, height):
    """A convex piece of a round wall between two angles: all pieces share their corners with their neighbours."""
    ring = [
        (radius * np.cos(angle), radius * np.sin(angle))
        for angle in (first, second)
        for radius in (inner, outer)
    ]
    points = [(x, y, z) for x, y in ring for z in (0.0, height)]
    return trimesh.Trimesh(points).convex_hull


def wall(count):
    """A round wall of exactly convex pieces."""
    angles = np.linspace(0, 2 * np.pi, count + 1)
    return [
        wedge(first, second, 0.036, 0.04, 0.09)
        for first, second in itertools.pairwise(angles)
    ]


def blocks():
    """Two boxes that share a face, a third that shares an edge with one of them, and a fourth apart."""
    places = [(0, 0, 0), (0.1, 0, 0), (0.2, 0.1, 0), (0.5, 0, 0)]
    found = []
    for place in places:
        box = trimesh.creation.box((0.1, 0.1, 0.1))
        found.append(box.apply_translation(place))
    return found


def as_obj(pieces, key="o"):
    """Write pieces as groups of an OBJ file; without a ``key`` they stand one after the other."""
    lines = []
    first = 1
    for number, piece in enumerate(pieces):
        lines += [f"{key} part_{number}"] if key else []
        lines += [f"v {x} {y} {z}" for x, y, z in piece.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in piece.faces + first]
        first += len(piece.vertices)
    return "\n".join(lines).encode()


def as_stl(pieces):
    return trimesh.util.concatenate(pieces).export(file_type="stl")


def as_glb(pieces):
    """Write each piece as a node, with corners of their own for each face, as Blender does."""
    scene = trimesh.Scene()
    for piece in pieces:
        flat = trimesh.Trimesh(
            piece.triangles.reshape(-1, 3),
            np.arange(3 * len(piece.faces)).reshape(-1, 3),
            process=False,
            vertex_normals=np.repeat(piece.face_normals, 3, axis=0),
        )
        scene.add_geometry(flat)
    return scene.export(file_type="glb")


@pytest.mark.parametrize("pieces", [wall(12), wall(44), blocks()], ids=len)
@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("o.obj", as_obj),
        ("g.obj", lambda pieces: as_obj(pieces, "g")),
        ("alike.obj", lambda pieces: as_obj(pieces).replace(b"part_", b"part #")),
        ("bare.obj", lambda pieces: as_obj(pieces, "")),
        ("shells.stl", as_stl),
        ("nodes.glb", as_glb),
    ],
)
def test_convex_pieces_of_others_collide_as_they_are(
    tmp_path, monkeypatch, pieces, name, write
):
    monkeypatch.setattr(convex, "cut", None)
    (tmp_path / name).write_bytes(write(pieces))
    read = read_mesh(tmp_path / name)
    (body,) = read.bodies
    volume = sum(piece.volume for piece in pieces)
    assert len(body.collisions) == len(pieces)
    assert total(body) == pytest.approx(volume, rel=1e-4)
    assert body.mass == pytest.approx(volume, rel=1e-4)
    assert len(body.visuals) == 1
    assert not [note for note in read.notes if "z is up" not in note]


def test_only_what_is_not_convex_cut_by(tmp_path, monkeypatch):
    """The handle is one piece that is not convex; the wall stays as it is."""
    cut = []
    monkeypatch.setattr(
        convex, "cut", lambda vertices, faces, *_: cut.append(faces) or [vertices]
    )
    handle = step().apply_translation([0.05, 0, 0])
    (tmp_path / "mug.obj").write_bytes(as_obj([*wall(12), handle]))
    body = read_mesh(tmp_path / "mug.obj").bodies[0]
    assert len(body.collisions) == 13
    assert [len(faces) for faces in cut] == [len(handle.faces)]
    assert body.mass == pytest.approx(
        sum(piece.volume for piece in (*wall(12), handle)), rel=1e-4
    )


def test_groups_of_one_surface_are_one_solid(tmp_path):
    """Such as the sides of a box that have a material each."""
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    sides = [
        trimesh.Trimesh(box.vertices, box.faces[[n, n + 1]]) for n in range(0, 12, 2)
    ]
    (tmp_path / "box.obj").write_bytes(as_obj(sides, "g"))
    body = read_mesh(tmp_path / "box.obj").bodies[0]
    assert len(body.collisions) == 1
    assert total(body) == pytest.approx(0.006, rel=1e-6)


@pytest.mark.parametrize("every", [1, 2])
def test_a_file_of_which_pieces_are_inside_out_is_read(tmp_path, every):
    pieces = [piece.copy() for piece in blocks()]
    for piece in pieces[::every]:
        piece.invert()
    (tmp_path / "inverted.obj").write_bytes(as_obj(pieces))
    body = read_mesh(tmp_path / "inverted.obj").bodies[0]
    assert len(body.collisions) == 4
    assert total(body) == pytest.approx(0.004, rel=1e-4)
    assert body.mass == pytest.approx(0.004, rel=1e-4)


@pytest.mark.slow
def can(sections):
    """A can without a lid, with thin walls."""
    profile = [[0, 0], [33, 0], [33, 100], [32, 100], [32, 1], [0, 1]]
    return trimesh.creation.revolve(np.array(profile) / 1000, sections=sections)


def test_what_takes_long_to_cut_is_cut_coarsely_and_said(tmp_path, monkeypatch):
    can(12).export(tmp_path / "can.stl")
    asked = []

    def slow(function, what, data, name, wanted, **limits):
        asked.append((wanted, "limit_s" in limits))
        if wanted == "fine":
            raise TooSlowError("it takes long")
        return called(function, what, data, name, wanted)

    monkeypatch.setattr(solids, "isolated", slow)
    made = read_mesh(tmp_path / "can.stl")
    assert asked == [("fine", True), ("coarse", False)]
    assert any("can.stl was cut into convex parts coarsely" in n for n in made.notes)
    # It is kept, and still said.
    solids._read.cache_clear()
    assert read_mesh(tmp_path / "can.stl").notes == made.notes
    assert len(asked) == 2


@pytest.mark.thorough
def test_a_can_of_950_triangles_is_cut_within_the_limit(tmp_path):
    mesh = can(119)
    mesh.export(tmp_path / "can.stl")
    made = read_mesh(tmp_path / "can.stl")
    assert not any("coarsely" in note for note in made.notes)
    assert total(made.bodies[0]) == pytest.approx(mesh.volume, rel=0.25)


@pytest.mark.parametrize("isolated", [True], indirect=True)
def test_a_hollow_cut_by_into_convex_parts_once(tmp_path, monkeypatch, isolated):
    mesh = step()
    mesh.export(tmp_path / "step.stl")
    made = read_mesh(tmp_path / "step.stl")
    (body,) = made.bodies
    assert 2 <= len(body.collisions) <= convex.MAX_PARTS
    assert body.mass == pytest.approx(mesh.volume, rel=1e-6)
    assert total(body) == pytest.approx(mesh.volume, rel=0.05)
    assert not any(_inside(geom, [0.16, 0.16, 0.05]) for geom in body.collisions)

    solids._read.cache_clear()
    monkeypatch.setattr(solids, "isolated", None)
    (tmp_path / "other.stl").write_bytes((tmp_path / "step.stl").read_bytes())
    assert len(read_mesh(tmp_path / "other.stl").bodies[0].collisions) == len(
        body.collisions
    )


def _inside(geom, point):
    return bool(geom.shape.to_trimesh().contains([point])[0])


def test_an_open_mesh_is_noted(tmp_path, monkeypatch):
    monkeypatch.setattr(convex, "cut", lambda vertices, *_: [vertices])
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.update_faces(np.arange(12) > 1)
    box.export(tmp_path / "open.stl")
    made = read_mesh(tmp_path / "open.stl")
    assert made.bodies[0].mass == pytest.approx(0.001, rel=1e-6)
    assert "not closed" in made.notes[0]


def stl(*corners):
    return trimesh.Trimesh(corners, [[0, 1, 2]], process=False).export(file_type="stl")


@pytest.mark.parametrize(
    ("name", "data", "options", "message"),
    [
        ("a.stl", None, {}, "No such file"),
        ("a.step", b"x", {}, "no kind that is read"),
        ("a.dae", b"x", {}, "can't be read as DAE"),
        ("a.stl", b"", {}, "no triangles"),
        ("a.glb", b"glTF....", {}, "can't be read as GLB"),
        ("a.obj", b"v 0 0 0\n", {}, "no triangles|can't be read"),
        ("a.stl", stl([0, 0, 0], [1, 0, 0], [0, 1, 0]), {}, "flat"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 1 2\nf 2 2 3\n", {}, "is flat"),
        (
            "a.stl",
            stl([0, 0, 0], [1, 0, 0], [0, np.nan, 0]),
            {},
            "no triangles|not a finite number",
        ),
        (
            "a.stl",
            trimesh.creation.box((100, 200, 300)).export(file_type="stl"),
            {},
            "0.001",
        ),
        (
            "a.stl",
            trimesh.creation.box((1, 1, 1)).export(file_type="stl"),
            {"scale": 1e-6},
            "another scale",
        ),
    ],
)
def test_what_cannot_be_read_is_one_clear_line(tmp_path, name, data, options, message):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(UserError, match=message) as error:
        read_mesh(tmp_path / name, **options)
    assert "\n" not in str(error.value)
    assert name in str(error.value)


def test_a_link_that_leads_out_of_the_folder_is_refused(tmp_path):
    inside = tmp_path / "inside"
    outside = tmp_path / "outside.stl"
    inside.mkdir()
    trimesh.creation.box((1, 1, 1)).export(outside)
    (inside / "a.stl").symlink_to(outside)
    with pytest.raises(UserError, match="is not in folder"):
        read_mesh(inside / "a.stl")
    assert read_mesh(inside / "a.stl", folder=tmp_path).bodies


def test_no_file_is_opened_that_an_obj_or_glb_names(tmp_path):
    """Materials and buffers would be read from other files, or from the network."""
    box = trimesh.creation.box((1, 1, 1)).export(file_type="obj")
    (tmp_path / "a.obj").write_text("mtllib /etc/passwd\nusemtl x\n" + box)
    assert read_mesh(tmp_path / "a.obj").bodies
    box = trimesh.Scene(trimesh.creation.box((1, 1, 1)))
    for uri in ("https://example.org/a.bin", "/dev/zero", "../a.bin"):
        tree = json.loads(trimesh.exchange.gltf.export_gltf(box)["model.gltf"])
        for buffer in tree["buffers"]:
            buffer["uri"] = uri
        text = json.dumps(tree).encode()
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A)
        (tmp_path / "a.glb").write_bytes(head + text)
        with pytest.raises(UserError, match="can't be read as GLB"):
            read_mesh(tmp_path / "a.glb")


@pytest.mark.parametrize("isolated", [True], indirect=True)
@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("LIMIT_S", 0.01, "takes more than"),
        ("sys.executable", "/bin/false", "process ended with 1"),
    ],
)
def test_a_reader_that_hangs_or_crashes_is_an_error(
    tmp_path, monkeypatch, isolated, name, value, message
):
    step().export(tmp_path / "step.stl")
    monkeypatch.setattr(f"core.support.sandbox.{name}", value)
    monkeypatch.setattr(solids, "FINE_S", 30.0 if name != "LIMIT_S" else value)
    with pytest.raises(UserError, match=message):
        read_mesh(tmp_path / "step.stl")


def test_too_many_triangles_are_refused(tmp_path, monkeypatch):
    trimesh.creation.icosphere(subdivisions=7, radius=0.1).export(tmp_path / "ball.stl")
    with pytest.raises(UserError, match="at most 200000"):
        read_mesh(tmp_path / "ball.stl")
    monkeypatch.setattr(solids, "MAX_MB", 1)
    with pytest.raises(UserError, match="MB"):
        solids.read_inside(tmp_path / "ball.stl", tmp_path, "mesh", 1)


@given(
    data=st.binary(max_size=400),
    kind=st.sampled_from(["obj", "stl", "glb"]),
    start=st.sampled_from(
        [b"", b"glTF\x02\0\0\0", b"solid a\nfacet", b"v 0 0 1\nf 1 1 9"]
    ),
)
@settings(max_examples=100, deadline=None)
def test_wild_bytes_are_read_or_refused(data, kind, start):
    """In this process, where the reader that runs in its own can be tried often."""
    try:
        file = Path(__file__).with_name(f"a.{kind}")
        found = convex.read_mesh(start + data, file, "fine")
    except UserError as error:
        assert "\n" not in str(error)  # noqa: PT017
    else:
        for key, array in found.items():
            if key != "volume" and not key.startswith("c"):
                assert np.isfinite(array).all(), key
