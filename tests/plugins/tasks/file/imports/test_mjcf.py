import sys

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import UserError
from core.geometry import Box
from core.scene import Scene
from core.support import sandbox
from plugins.tasks.file.imports import mjcf, read_bodies
from plugins.tasks.file.named_files import Files
from plugins.tasks.file.task import FileTask
from tests.plugins.tasks.file.imports.conftest import called
from tests.support.text import replaced_all


@pytest.fixture(autouse=True)
def within(monkeypatch, tmp_path):
    """Files are compiled in this process, which starts no other for each, and logs of warnings do not stay."""
    monkeypatch.setattr(mjcf, "isolated", called)
    monkeypatch.chdir(tmp_path)


def written(folder, body, before="", after=""):
    file = folder / "model.xml"
    file.write_text(f"<mujoco>{before}<worldbody>{body}</worldbody>{after}</mujoco>")
    return file


def read(folder, body, before="", after="", **options):
    return read_bodies(written(folder, body, before, after), **options)


NUMBER = st.floats(-2, 2).map(lambda value: round(value, 3))
UNIT = st.tuples(NUMBER, NUMBER, NUMBER).filter(lambda v: np.linalg.norm(v) > 0.3)


def words(values):
    return " ".join(f"{value:g}" for value in values)


def place(draw):
    return f'pos="{words(draw(UNIT))}" quat="{words([draw(NUMBER), *draw(UNIT)])}"'


@st.composite
def geoms(draw):
    kind = draw(st.sampled_from(["sphere", "capsule", "cylinder", "box"]))
    size = draw(UNIT)
    size = words(0.05 + np.abs(size) / 5)
    weight = draw(st.sampled_from(['mass="0.7"', 'density="300"', "", 'class="thin"']))
    return f'<geom type="{kind}" size="{size}" {place(draw)} {weight}/>'


@st.composite
def bodies(draw, depth=0):
    joint = draw(
        st.sampled_from(
            ["hinge", "slide", "ball", *(["free"] if depth == 0 else []), None]
        )
    )
    inside = "<geom size='0.1'/>" + "".join(draw(st.lists(geoms(), max_size=2)))
    if joint == "free":
        inside += "<freejoint/>"
    elif joint:
        more = draw(
            st.sampled_from(
                [
                    "",
                    'range="-1 1.5"',
                    'range="0.5 3" limited="false"',
                    'ref="0.4" range="-1 1"',
                ]
            )
        )
        more += draw(
            st.sampled_from(
                ["", ' damping="0.3" stiffness="2" springref="0.2" frictionloss="0.1"']
            )
        )
        more = "" if joint == "ball" else more
        inside += f'<joint type="{joint}" pos="{words(draw(UNIT))}" axis="{words(draw(UNIT))}" {more}/>'
    if depth < 2:
        inside += "".join(draw(st.lists(bodies(depth=depth + 1), max_size=2)))
    return f"<body {place(draw)}>{inside}</body>"


THIN = '<default><default class="thin"><geom contype="0" conaffinity="0" density="50"/></default></default>'


@given(
    world=st.lists(bodies(), min_size=1, max_size=3).map("".join),
    parts=st.randoms(use_true_random=False),
)
@settings(max_examples=30, deadline=None)
def test_all_moves_as_in_mujoco(tmp_path_factory, world, parts):
    """Bodies have no names, so that they come in the order of the file; the joints are moved, by our own formulas."""
    file = written(tmp_path_factory.mktemp("model"), world, THIN)
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    made = read_bodies(file)
    joints = {
        f"body{body}": model.joint(number)
        for number, body in enumerate(model.jnt_bodyid)
    }
    starts = {}
    for joint in made.joints:
        other = joints.pop(joint.body)
        ball = joint.kind == "ball"
        assert joint.kind == {1: "ball", 2: "slider", 3: "hinge"}[other.type[0]]
        assert (joint.damping, joint.friction) == (
            other.damping[0],
            other.frictionloss[0],
        )
        assert (joint.limited, joint.stiffness) == (
            other.limited[0],
            other.stiffness[0],
        )
        if not ball:
            assert joint.rest == other.qpos_spring[0]
            low, high = (joint.lower, joint.upper) if joint.limited else (-1, 1)
            starts[joint.name] = data.qpos[other.qposadr[0]] = parts.uniform(low, high)
    assert {joint.type[0] for joint in joints.values()} <= {0}
    mujoco.mj_forward(model, data)
    weights = np.bincount(model.body_weldid, model.body_mass, model.nbody)
    shapes = 0
    for body in Scene(made.bodies, made.joints).with_starts(starts).bodies:
        number = int(body.name.removeprefix("body"))
        np.testing.assert_allclose(body.pose.position, data.xpos[number], atol=1e-6)
        np.testing.assert_allclose(
            body.pose.rotation.as_matrix().ravel(), data.xmat[number], atol=1e-6
        )
        assert body.fixed == (model.body_weldid[number] == 0)
        assert body.fixed or body.mass == pytest.approx(weights[number])
        for geom in body.visuals:
            at = body.pose @ geom.pose
            near = np.linalg.norm(data.geom_xpos - at.position, axis=1) < 1e-5
            near &= (
                np.abs(data.geom_xmat - at.rotation.as_matrix().ravel()).max(axis=1)
                < 1e-5
            )
            if isinstance(geom.shape, Box):
                near &= (
                    np.abs(model.geom_size - np.array(geom.shape.size) / 2).max(axis=1)
                    < 1e-6
                )
            assert near.any()
            shapes += 1
    assert shapes == model.ngeom
    assert sum(len(body.collisions) for body in made.bodies) == np.count_nonzero(
        model.geom_contype
    )


def test_a_prefix_renames_all(tmp_path):
    door = '<body name="frame"><geom size="0.1"/><body name="door" pos="1 0 0"><joint name="hinge"/>'
    door += '<geom size="0.1"/></body></body>'
    made = read(tmp_path, door, prefix="my_")
    assert [body.name for body in made.bodies] == ["my_frame", "my_door"]
    assert [(joint.name, joint.body) for joint in made.joints] == [
        ("my_hinge", "my_door")
    ]
    np.testing.assert_allclose(made.bodies[1].pose.position, (1, 0, 0), atol=1e-12)
    assert made.joints[0].parent is None, "as in MuJoCo it collides with what is fixed"


RING = '<compiler meshdir="meshes"/><asset><mesh file="ring.stl" scale="2 2 2"/><texture name="t" file="none.png"/>'
RING += '<material name="red" texture="t" rgba="1 0 0 1"/></asset>'


def test_a_mesh_collides_as_its_hull_and_is_drawn_whole(tmp_path):
    ring = trimesh.creation.annulus(0.03, 0.05, 0.1).apply_translation((0.1, 0, 0))
    (tmp_path / "meshes").mkdir()
    ring.export(tmp_path / "meshes" / "ring.stl")
    (tmp_path / "part.xml").write_text(
        '<mujoco><body><freejoint/><geom type="mesh" mesh="ring" material="red"/></body></mujoco>'
    )
    (body,) = read(tmp_path, '<include file="part.xml"/>', RING).bodies
    solid = body.collisions[0]
    drawn = body.visuals[0]
    assert solid.shape.volume == pytest.approx(8 * ring.convex_hull.volume, rel=1e-5)
    assert drawn.shape.volume == pytest.approx(8 * ring.volume, rel=1e-5)
    bounds = drawn.shape.to_trimesh().apply_transform(drawn.pose.matrix).bounds
    np.testing.assert_allclose(bounds, 2 * ring.bounds, atol=1e-6)
    assert drawn.color == (1, 0, 0, 1)


def test_what_is_left_out_is_said(tmp_path):
    text = '<geom type="plane" size="1 1 1"/><geom type="hfield" hfield="h"/><light/>'
    text += '<body><joint/><geom size="1"/><camera/></body>'
    notes = "\n".join(
        read(tmp_path, text, "<option/>", "<actuator><motor/></actuator>").notes
    )
    for what in (
        "plane",
        "hfield",
        "light",
        "camera",
        "option",
        "actuator",
    ):
        assert what in notes


MESH = "<geom type='mesh' mesh='a'/>"
ASSET = "<asset><mesh name='a' file='{}'/></asset>"


@pytest.mark.parametrize(
    ("body", "before", "message"),
    [
        (
            "<body><joint/><joint axis='1 0 0'/><geom size='1'/></body>",
            "",
            "has 2 joints",
        ),
        ("<include file='/etc/passwd'/>", "", "is not in folder"),
        ("<include file='model.xml'/>", "", "included twice"),
        (MESH, ASSET.format("/etc/passwd.stl"), "is not in folder"),
        (MESH, ASSET.format("../a.obj"), "is not in folder"),
        (
            MESH,
            "<compiler meshdir='/etc'/>" + ASSET.format("a.obj"),
            "is not in folder",
        ),
        (MESH, ASSET.format("https://x.org/a.obj"), "No such file"),
        (MESH, ASSET.format("a.xml"), "no kind that is read"),
        (MESH, "", "mesh 'a' not found"),
        ("<geom size='nan'/>", "", "nan size"),
        ("<geom size='1e8'/>", "", "from the origin; at most 20 m"),
        ("<body><freejoint/><geom size='1' mass='1e300'/></body>", "", "mass|kg"),
        ("<body><joint name='a&#10;b'/><geom size='1'/></body>", "", "its name"),
        (
            "<body pos='1e9 0 0'><geom size='1'/></body>",
            "",
            "from the origin; at most 20 m",
        ),
        (
            "<body><joint type='slide' range='0 1e300'/><geom size='1'/></body>",
            "",
            "its range",
        ),
        ("<geom size='1' friction='1e300'/>", "", "friction"),
        ("<body><joint pos='1e9 0 0'/><geom size='1'/></body>", "", "joint .* 20 m"),
        ("<body pos='nan 0 0'><geom size='1'/></body>", "", "nan|finite"),
        ("<geom type='teapot' size='1'/>", "", "invalid keyword: 'teapot'"),
        ("<body name='a b'><geom size='1'/></body>", "", "rename it"),
        ("<body>" * 70 + "</body>" * 70, "", "deep"),
        (
            "<replicate count='501'><body><geom size='1'/></body></replicate>",
            "",
            "a number up to 500",
        ),
        (
            "<replicate count='1000000000'><geom size='1'/></replicate>",
            "",
            "a number up to 500",
        ),
        (
            "<replicate count=' 1e9'><geom size='1'/></replicate>",
            "",
            "a number up to 500",
        ),
        (
            "<replicate count='500'>" * 9 + "<geom size='1'/>" + "</replicate>" * 9,
            "",
            "more than 20000 elements",
        ),
        (
            MESH,
            "<asset><mesh name='a' builtin='sphere' params='9999'/></asset>",
            "at least 4 vertices",
        ),
    ],
)
def test_what_cannot_be_read_is_one_clear_line(tmp_path, body, before, message):
    with pytest.raises(UserError, match=message) as error:
        read(tmp_path, body, before)
    assert "\n" not in str(error.value)
    assert str(tmp_path / "model.xml") in str(error.value)


WORDS = [
    "body",
    "geom",
    "joint",
    "frame",
    "inertial",
    "default",
    "freejoint",
    "asset",
    "mesh",
    "compiler",
    "replicate",
]
KEYS = [
    "name",
    "class",
    "type",
    "size",
    "pos",
    "fromto",
    "mesh",
    "file",
    "range",
    "mass",
    "count",
    "vertex",
]
VALUES = [
    "",
    "1",
    "0 0 0",
    "1 2 3",
    "nan",
    "1e400",
    "-1",
    "mesh",
    "hinge",
    "free",
    "box",
    "a",
    "main",
    "a.stl",
]


@st.composite
def wild(draw, depth=0):
    tag = draw(st.sampled_from(WORDS))
    given = draw(st.dictionaries(st.sampled_from(KEYS), st.sampled_from(VALUES)))
    children = (
        "".join(draw(st.lists(wild(depth=depth + 1), max_size=3))) if depth < 3 else ""
    )
    return f"<{tag} {' '.join(f'{key}={value!r}' for key, value in given.items())}>{children}</{tag}>"


@pytest.mark.thorough
@given(body=wild(), before=wild())
@settings(max_examples=100, deadline=None)
def test_wild_input_is_read_or_refused(tmp_path_factory, body, before):
    try:
        read(tmp_path_factory.mktemp("wild"), body, before)
    except UserError as error:
        assert "\n" not in str(error)  # noqa: PT017


def test_the_compiler_is_a_process_of_its_own(tmp_path, monkeypatch):
    """What it finds, what it refuses, and its crash come back."""
    monkeypatch.setattr(mjcf, "isolated", sandbox.isolated)
    written(tmp_path, '<body><freejoint/><geom size="0.1" mass="2"/></body>')
    assert Files(tmp_path).bodies("model.xml", "", fixed=True).bodies[
        0
    ].mass == pytest.approx(2)
    with pytest.raises(UserError, match="size 0 must be positive"):
        read(tmp_path, "<geom size='-1'/>")
    monkeypatch.setattr("sys.executable", "/bin/false")
    with pytest.raises(UserError, match="process ended with 1"):
        read(tmp_path, "<geom size='1'/>")


def test_without_mujoco_it_says_what_to_install(tmp_path, monkeypatch):
    written(tmp_path, "")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.delitem(sys.modules, "plugins.tasks.file.imports.mjcf")
    with pytest.raises(UserError, match="pip install"):
        Files(tmp_path).bodies("model.xml", "", fixed=True)


def test_a_slide_keeps_its_damping_and_range(tmp_path):
    block = '<body name="block" pos="0 0 2"><joint name="rail" type="slide" damping="20" range="-1.5 1.5"/>'
    (rail,) = read(
        tmp_path, block + '<geom type="box" size="0.05 0.05 0.05" mass="1"/></body>'
    ).joints
    assert (rail.kind, rail.damping, rail.lower, rail.upper) == (
        "slider",
        20,
        -1.5,
        1.5,
    )


BENCH = """
<body name="thing"><freejoint/><geom type="box" size=".03 .03 .05" mass=".3"/></body>
<body name="arm0"><joint axis="0 0 1"/><geom size=".2" mass="2" contype="0" conaffinity="0"/>
<body name="hand"><joint axis="0 1 0"/><geom size=".1" mass="1"/></body></body>"""


def test_the_arm_of_a_bench_is_left_out_with_its_hand(tmp_path):
    with pytest.raises(UserError, match=r"without: \[arm0\] in the import"):
        read(tmp_path, BENCH)

    found = read(tmp_path, BENCH, without=("arm*",))
    assert [body.name for body in found.bodies] == ["thing"]
    assert not found.joints


def test_a_body_to_leave_out_that_is_not_there_is_said(tmp_path):
    with pytest.raises(UserError, match="no body to leave out 'amr0'"):
        read(tmp_path, BENCH, without=("amr0",))


def test_a_scene_file_leaves_bodies_of_its_import_out(tmp_path):
    written(tmp_path, BENCH)
    file = tmp_path / "scene.yaml"
    file.write_text(
        "name: Bench\ndescription: Push the thing to the left by 0.2 m.\n"
        "imports:\n  - {file: model.xml, position: [0.6, 0, 0.05], prefix: b_, without: [arm0]}\n"
        "goals:\n  - {bodies: [b_thing], moved: [null, 0.2, null]}\n"
    )
    names = [body.name for body in FileTask(str(file)).scene(0).bodies]
    assert names == ["floor", "table", "b_thing"]


TIN = '<geom type="cylinder" size="0.03 0.05" density="300"/>'


@pytest.mark.parametrize(
    ("body", "free"),
    [
        (f'<body><body name="object">{TIN}</body></body>', ["object"]),  # robosuite's
        (f'<body name="a">{TIN}</body><body name="b">{TIN}</body>', ["a", "b"]),
        (
            f'<body name="a">{TIN}<body name="b" pos="0 0 1">{TIN}</body></body>',
            ["a"],
        ),
        (
            f'<body name="a"><body name="b">{TIN}</body><body name="c">{TIN}</body></body>',
            ["a"],
        ),
    ],
)
def test_what_has_no_joint_is_set_free_by_a_word(tmp_path, body, free):
    fixed = read(tmp_path, body)
    assert [made.name for made in fixed.bodies if made.mass] == []

    moving = read(tmp_path, body, fixed=False)
    assert [made.name for made in moving.bodies if made.mass] == free
    assert moving.joints == ()
    volume = np.pi * 0.03**2 * 0.1
    tins = body.count("<geom")
    total = sum(made.mass for made in moving.bodies)
    assert total == pytest.approx(tins * 300 * volume, rel=1e-3)


def test_a_scene_of_what_stands_names_the_word_that_sets_it_free(tmp_path):
    written(tmp_path, f'<body name="a">{TIN}</body>')
    scene = tmp_path / "scene.yaml"
    text = (
        "name: Tin\ndescription: Push the tin to the left.\n"
        "imports: [{file: model.xml, position: [0.6, 0, 0.05]SET}]\n"
        "goals: [{bodies: [a], moved: [null, 0.2, null]}]\n"
    )
    scene.write_text(replaced_all(text, ("SET", "")))
    with pytest.raises(UserError, match="fixed: false"):
        FileTask(scene)
    scene.write_text(replaced_all(text, ("SET", ", fixed: false")))
    assert [body.name for body in FileTask(scene).scene(0).bodies if body.mass] == ["a"]
