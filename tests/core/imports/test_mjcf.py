import math

import mujoco
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from core.errors import UserError
from core.geometry import Box, Pose
from core.imports import read_mjcf
from core.scene import Scene


def written(folder, text):
    file = folder / "model.xml"
    file.write_text(text)
    return file


def read(folder, body, before="", **options):
    return read_mjcf(written(folder, f"<mujoco>{before}<worldbody>{body}</worldbody></mujoco>"), **options)


NUMBER = st.floats(-2, 2).map(lambda value: round(value, 3))
UNIT = st.tuples(NUMBER, NUMBER, NUMBER).filter(lambda v: np.linalg.norm(v) > 0.3)


def words(values):
    return " ".join(f"{value:g}" for value in values)


@st.composite
def turned(draw):
    kind = draw(st.sampled_from(["quat", "euler", "axisangle", "zaxis", "xyaxes", None]))
    axis = draw(UNIT)
    match kind:
        case "quat":
            return f'quat="{words([draw(NUMBER), *axis])}"'
        case "euler":
            return f'euler="{words(draw(st.tuples(NUMBER, NUMBER, NUMBER)))}"'
        case "axisangle":
            return f'axisangle="{words([*axis, draw(NUMBER)])}"'
        case "zaxis":
            return f'zaxis="{words(axis)}"'
        case "xyaxes":
            other = draw(UNIT.filter(lambda v: np.linalg.norm(np.cross(v, axis)) > 0.1))
            return f'xyaxes="{words([*axis, *other])}"'
    return ""


def place(draw):
    return f'pos="{words(draw(st.tuples(NUMBER, NUMBER, NUMBER)))}" {draw(turned())}'


@st.composite
def geoms(draw):
    kind, size = (
        draw(st.sampled_from(["sphere", "capsule", "cylinder", "box"])),
        draw(st.tuples(*[st.floats(0.05, 0.4)] * 3)),
    )
    where = place(draw)
    if kind != "sphere" and draw(st.booleans()):
        ends = draw(st.tuples(UNIT, UNIT).filter(lambda e: np.linalg.norm(np.subtract(*e)) > 0.1))
        where = f'fromto="{words([*ends[0], *ends[1]])}"'
    weight = draw(st.sampled_from(['mass="0.7"', 'density="300"', ""]))
    kind_of = draw(st.sampled_from(["", 'class="thin"']))
    return f'<geom type="{kind}" size="{words(size)}" {where} {weight} {kind_of}/>'


@st.composite
def bodies(draw, depth=0):
    joint = draw(
        st.sampled_from(["hinge", "slide", "ball", "free", None, None] if depth == 0 else ["hinge", "slide", None])
    )
    inside = "".join(draw(st.lists(geoms(), min_size=1, max_size=2)))
    if draw(st.booleans()):
        inside = f"<frame {place(draw)}>{inside}</frame>"
    if joint == "free":
        inside += "<freejoint/>"
    elif joint == "ball":
        inside += f'<joint type="ball" pos="{words(draw(UNIT))}"/>'
    elif joint:
        more = draw(st.sampled_from(["", 'range="-1 1.5"', 'range="0.5 3" limited="false"', 'ref="0.4" range="-1 1"']))
        more += draw(st.sampled_from(["", ' damping="0.3" stiffness="2" springref="0.2" frictionloss="0.1"']))
        inside += f'<joint type="{joint}" pos="{words(draw(UNIT))}" axis="{words(draw(UNIT))}" {more}/>'
    if depth < 2:
        inside += "".join(draw(st.lists(bodies(depth=depth + 1), max_size=2)))
    return f"<body {place(draw)}>{inside}</body>"


@st.composite
def models(draw):
    sequence = "".join(draw(st.permutations("xyz")))
    sequence = draw(st.sampled_from([sequence, sequence.upper(), sequence[:2] + sequence[2].upper()]))
    angle = draw(st.sampled_from(["radian", "degree"]))
    world = "".join(draw(st.lists(bodies(), min_size=1, max_size=3)))
    default = '<default><geom density="500"/>'
    default += '<default class="thin"><geom contype="0" conaffinity="0" density="50"/></default></default>'
    return f'<mujoco><compiler angle="{angle}" eulerseq="{sequence}"/>{default}<worldbody>{world}</worldbody></mujoco>'


@given(text=models())
@settings(max_examples=30, deadline=None)
def test_all_is_where_mujoco_has_it(tmp_path_factory, text):
    """Poses, joints and masses; bodies have no names, so that they come in the order of the file."""
    file = written(tmp_path_factory.mktemp("model"), text)
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    try:
        made = read_mjcf(file)
    except UserError as error:
        if "no collision shape" not in str(error):  # those of a body that moves were only drawn
            raise
        return
    scene = Scene(made.bodies, made.joints)
    weights = np.zeros(model.nbody)
    for number in range(model.nbody):
        weights[model.body_weldid[number]] += model.body_mass[number]
    shapes = 0
    for body in made.bodies:
        if body.name == "world":
            continue
        number = int(body.name.removeprefix("body"))
        np.testing.assert_allclose(body.pose.position, data.xpos[number], atol=1e-6)
        np.testing.assert_allclose(body.pose.rotation.as_matrix().ravel(), data.xmat[number], atol=1e-6)
        assert body.fixed == (model.body_weldid[number] == 0)
        if not body.fixed:
            assert body.mass == pytest.approx(weights[number], rel=1e-6)
        for geom in body.visuals:
            place = body.pose @ geom.pose
            near = np.linalg.norm(data.geom_xpos - place.position, axis=1) < 1e-5
            near &= np.abs(data.geom_xmat - place.rotation.as_matrix().ravel()).max(axis=1) < 1e-5
            if isinstance(geom.shape, Box):
                near &= np.abs(model.geom_size - np.array(geom.shape.size) / 2).max(axis=1) < 1e-6
            assert near.any()
            shapes += 1
    assert shapes == model.ngeom
    kinds = {
        int(mujoco.mjtJoint.mjJNT_HINGE): "hinge",
        int(mujoco.mjtJoint.mjJNT_SLIDE): "slider",
        int(mujoco.mjtJoint.mjJNT_BALL): "ball",
    }
    joints = {f"body{model.jnt_bodyid[j]}": j for j in range(model.njnt) if int(model.jnt_type[j]) in kinds}
    assert {joint.body for joint in made.joints} == set(joints)
    for joint in made.joints:
        j, pose = joints[joint.body], scene[joint.body].pose
        assert joint.kind == kinds[int(model.jnt_type[j])]
        np.testing.assert_allclose(pose.apply(joint.origin), data.xanchor[j], atol=1e-6)
        dof, start = model.jnt_dofadr[j], model.jnt_qposadr[j]
        assert joint.damping == pytest.approx(model.dof_damping[dof].ravel()[0])
        assert joint.friction == pytest.approx(model.dof_frictionloss[dof])
        if joint.kind != "ball":
            np.testing.assert_allclose(pose.rotation.apply(joint.axis), data.xaxis[j], atol=1e-6)
            assert joint.limited == bool(model.jnt_limited[j])
            if joint.limited:
                assert (joint.lower, joint.upper) == pytest.approx(tuple(model.jnt_range[j]))
            assert joint.start == pytest.approx(model.qpos0[start])
            assert joint.rest == pytest.approx(model.qpos_spring[start])
            assert joint.stiffness == pytest.approx(model.jnt_stiffness[j].ravel()[0])


def test_pose_and_prefix_move_and_rename_all(tmp_path):
    pose = Pose.xyz_rpy((1, 2, 3), (0, 0, math.pi / 2))
    door = '<body name="frame"><geom size="0.1"/><body name="door" pos="1 0 0"><joint name="hinge"/>'
    door += '<geom size="0.1"/></body></body>'
    made = read(tmp_path, door, pose=pose, prefix="my_")
    frame, leaf = made.bodies
    assert (frame.name, leaf.name, made.joints[0].name, made.joints[0].body) == (
        "my_frame",
        "my_door",
        "my_hinge",
        "my_door",
    )
    np.testing.assert_allclose(leaf.pose.position, (1, 3, 3), atol=1e-12)
    assert made.joints[0].parent is None, "as in MuJoCo it collides with what is fixed"


def test_a_mesh_collides_as_its_hull_and_is_drawn_whole(tmp_path):
    ring = trimesh.creation.annulus(0.03, 0.05, 0.1)
    (tmp_path / "meshes").mkdir()
    ring.export(tmp_path / "meshes" / "ring.stl")
    assets = '<compiler meshdir="meshes"/><asset><mesh file="ring.stl" scale="2 2 2"/>'
    assets += '<material name="red" rgba="1 0 0 1"/></asset>'
    made = read(tmp_path, '<body><freejoint/><geom type="mesh" mesh="ring" material="red"/></body>', assets)
    (body,) = made.bodies
    assert body.collisions[0].shape.volume == pytest.approx(8 * ring.convex_hull.volume, rel=1e-3)
    assert body.visuals[0].shape.volume == pytest.approx(8 * ring.volume, rel=1e-3)
    assert body.visuals[0].color == (1, 0, 0, 1)
    assert body.mass == pytest.approx(8000 * ring.volume, rel=1e-3)


def test_what_is_left_out_is_said(tmp_path):
    text = '<geom type="plane" size="1 1 1"/><light/><body><joint armature="1"/><geom size="1"/><camera/></body>'
    notes = "\n".join(read(tmp_path, text, "<option/><actuator><motor/></actuator>").notes)
    for what in ("plane", "<light>", "<camera>", "armature", "<option>", "<actuator>"):
        assert what in notes


@pytest.mark.parametrize(
    ("body", "before", "message"),
    [
        ("<body><joint/><joint/><geom size='1'/></body>", "", "has 2 joints"),
        ("<include file='/etc/passwd'/>", "", "one file"),
        ("<geom type='mesh' mesh='a'/>", "<asset><mesh name='a' file='/etc/passwd.stl'/></asset>", "is not in folder"),
        ("<geom type='mesh' mesh='a'/>", "<asset><mesh name='a' file='../a.obj'/></asset>", "is not in folder"),
        ("<geom type='mesh' mesh='a'/>", "<asset><mesh name='a' file='https://x.org/a.obj'/></asset>", "no mesh"),
        ("<geom type='mesh' mesh='a'/>", "<asset><mesh name='a'/></asset>", "file"),
        ("<geom type='mesh' mesh='b'/>", "", "no mesh 'b'"),
        ("<geom size='nan'/>", "", "expected a number"),
        ("<geom size='-1'/>", "", "radius"),
        ("<geom type='teapot' size='1'/>", "", "no type 'teapot'"),
        ("<geom class='x' size='1'/>", "", "no class 'x'"),
        ("<body><joint/></body>", "", "no mass"),
        ("<body><joint axis='0 0 0'/><geom size='1'/></body>", "", "axis needs a length"),
        ("<body name='a b'/>", "", "rename it"),
        ("<body name='a'><geom size='1'/></body>" * 2, "", "same name"),
        ("<body>" * 70 + "</body>" * 70, "", "deep"),
        ("<body/>" * 501, "", "more than 500"),
    ],
)
def test_what_cannot_be_read_is_one_clear_line(tmp_path, body, before, message):
    with pytest.raises(UserError, match=message) as error:
        read(tmp_path, body, before)
    assert "\n" not in str(error.value)
    assert str(tmp_path / "model.xml") in str(error.value)


TAGS = st.sampled_from(
    ["body", "geom", "joint", "frame", "inertial", "default", "freejoint", "asset", "mesh", "compiler"]
)
KEYS = st.sampled_from(
    ["name", "class", "type", "size", "pos", "quat", "euler", "fromto", "mesh", "file", "range", "mass"]
)
VALUES = st.sampled_from(
    ["", "1", "0 0 0", "1 2 3", "nan", "1e400", "-1", "mesh", "hinge", "free", "box", "a", "main", "../a.stl"]
)


@st.composite
def wild(draw, depth=0):
    tag, attributes = draw(TAGS), draw(st.dictionaries(KEYS, VALUES, max_size=4))
    children = "".join(draw(st.lists(wild(depth=depth + 1), max_size=3))) if depth < 3 else ""
    given = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    return f"<{tag} {given}>{children}</{tag}>"


@given(body=wild(), before=wild())
@settings(max_examples=100, deadline=None)
def test_wild_input_is_read_or_refused(tmp_path_factory, body, before):
    try:
        read(tmp_path_factory.mktemp("wild"), body, before)
    except UserError as error:
        assert "\n" not in str(error)  # noqa: PT017
