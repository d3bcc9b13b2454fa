"""Arms as their owners have them: other formats, odd names, incomplete files, meshes elsewhere, small arms."""

import json
import re
import shutil
import zipfile

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from core.design import Tool
from core.errors import UserError
from core.geometry import Pose
from core.robot.kinematics import arm_of, link_frames
from core.robot.solids import robot_solids
from core.robot.writing import write
from plugins.robots.own_arm import read_robot
from tests.plugins.robots.conftest import take
from tests.support.outside_arm import FLANGE, HOME
from tests.support.text import replaced_all

pytestmark = pytest.mark.usefixtures("in_this_process")


@pytest.fixture
def package(file, tmp_path):
    """A copy of the arm's package that a test may change; its URDF."""
    shutil.copytree(file.parents[1], tmp_path / "outside_arm")
    return tmp_path / "outside_arm/urdf/arm.urdf"


def change(urdf, *changes):
    urdf.write_text(replaced_all(urdf.read_text(), *changes))
    return urdf


def said(capsys, *words):
    """What ``vlmgineer import`` says of an arm."""
    take(["robot=urdf", *words])
    return capsys.readouterr().out


def numbers_of(words):
    """The numbers that words to type give, as ``robot.home=[0,1]``."""
    return json.loads(words.partition("=")[2])


def mass_of(robot):
    return sum(link.inertial.mass for link in robot.description.links.values())


def words_of(text):
    """The words to type, but for where the flange's face is."""
    lines = text.splitlines()
    return [line for line in lines if line.startswith("robot.") and "face" not in line]


# --- MJCF -----------------------------------------------------------------------------------------------------------

DOWN = (0.0, 0.35 + np.radians(20), 1.5, 0.0, 1.29, 0.0)  # a home of the arm below


@pytest.fixture
def six(tmp_path):
    """A file of the arm that a test may change."""
    file = tmp_path / "six.xml"
    file.write_text(mjcf())
    return file


def mjcf(*, site="flange", motors=True):
    """An arm of six joints with classes, an included part, a scene around it, and a reference angle."""
    axes = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
    offsets = (0.12, 0.23, 0.42, 0.22, 0.18, 0.07)
    lengths = (0.15, 0.36, 0.21, 0.13, 0.06, 0.05)
    body = f'<site name="{site}" pos="0 0 0.05"/>'
    for number in range(6, 0, -1):
        axis = axes[number - 1]
        half = lengths[number - 1] / 2
        ref = ' ref="20"' if number == 2 else ""
        body = (
            f'<body name="arm/link {number}" pos="0 0 {offsets[number - 1]}">'
            f'<joint name="turn {number}" axis="{axis}"{ref}/>'
            f'<geom type="cylinder" size="0.04 {half}" pos="0 0 {half}" mass="0.8"/>{body}</body>'
        )
    drives = "".join(
        f'<position joint="turn {number}" kp="100" forcerange="-50 50" gear="2"/>'
        for number in range(1, 7)
    )
    return (
        '<mujoco model="six"><compiler autolimits="true"/><default><joint range="-166 166" armature="0.2"/></default>'
        '<worldbody><geom name="ground" type="plane" size="1 1 0.1"/><light pos="0 0 2"/>'
        '<body name="cup" pos="1 0 0"><freejoint/><geom size="0.03"/></body>'
        f'<body name="base"><geom type="cylinder" size="0.08 0.05" mass="3"/>{body}</body></worldbody>'
        f"<actuator>{drives if motors else ''}</actuator></mujoco>"
    )


def test_an_arm_of_mjcf_is_as_mujoco_reads_it(six, capsys):
    printed = said(capsys, f"robot.path={six}", "at=[0.5,0,0.4]")
    assert "left out, as no arms: cup" in printed
    assert "MJCF has no limits of speed, 3.14 rad/s is taken" in printed
    assert "tools are bolted to 'flange'" in printed
    (words,) = words_of(printed)
    robot = read_robot(six, numbers_of(words))
    assert robot.motor_inertia == (0.2,) * 6
    arm = arm_of(robot)
    np.testing.assert_allclose(arm.upper, [np.radians(166)] * 6, atol=1e-6)
    np.testing.assert_allclose(arm.effort_limits, [100.0] * 6)
    np.testing.assert_allclose(arm.velocity_limits, [3.14] * 6)
    np.testing.assert_allclose(
        arm.forward(arm.home).position, (0.5, 0.0, 0.4), atol=1e-3
    )

    # Where MuJoCo has the flange, with the same angles.
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(six))
    data = mujoco.MjData(model)
    data.qpos[-6:] = [0.3, 0.2, 1.1, -0.4, 0.9, 0.1]
    mujoco.mj_forward(model, data)
    frames = link_frames(robot, Tool(), data.qpos[-6:][None], np.zeros((1, 0)))
    rotation, position = (values[0] for values in frames["tool_mount"])
    np.testing.assert_allclose(position, data.site("flange").xpos, atol=1e-6)
    wanted = data.site("flange").xmat.reshape(3, 3) @ robot.mount.rotation.as_matrix()
    np.testing.assert_allclose(rotation, wanted, atol=1e-6)


def test_an_arm_of_mjcf_of_parts_with_meshes(six, tmp_path, package, capsys):
    """Includes, meshes with a scale, an only drawn mesh that is missing, and a base that is free."""
    shutil.copy(package.parents[1] / "meshes/forearm.stl", tmp_path / "bar.stl")
    (tmp_path / "parts.xml").write_text(
        '<mujocoinclude><asset><mesh name="bar" file="bar.stl" scale="0.001 0.001 0.001"/>'
        '<mesh file="shine.stl"/></asset></mujocoinclude>'
    )
    shown = (
        '<geom type="mesh" mesh="bar" pos="0 0 0.1" mass="0.1"/>'
        '<geom type="mesh" mesh="shine" contype="0" conaffinity="0"/>'
    )
    change(
        six,
        ("<worldbody>", '<include file="parts.xml"/><worldbody>'),
        ("<site ", f"{shown}<site "),
        ('<body name="base">', '<body name="base"><freejoint/>'),
    )
    printed = said(capsys, f"robot.path={six}", "at=[0.5,0,0.4]", "robot.flange=flange")
    assert "its base, which is free there, is fixed here" in printed
    assert f"not drawn, as there is no file {tmp_path / 'shine.stl'}" in printed
    (words,) = words_of(printed)
    robot = read_robot(six, numbers_of(words))
    halves = [
        solid.bounds()[1].round(4).tolist() for solid in robot_solids(robot, False)
    ]
    assert sorted([0.055, 0.06, 0.1325]) in map(sorted, halves)


def test_where_an_arm_of_mjcf_stands_in_its_world_means_nothing(six, caplog):
    plain = read_robot(six, DOWN)
    change(six, ('name="base"', 'name="base" pos="-0.5 0.2 0.7" euler="0 0 90"'))
    assert read_robot(six, DOWN).description == plain.description
    assert "robot.base=[x,y,z,yaw] places it" in caplog.text
    with pytest.raises(UserError, match="no link 'nobody'"):
        read_robot(six, DOWN, without=["nobody"])


def test_a_ball_and_sliders_of_mjcf_are_held_or_left_out(six):
    """A carriage of two joints bears the arm, a lamp hangs on a ball."""
    lamp = '<body name="lamp"><joint name="swing" type="ball" range="0 90"/><geom size="0.02"/></body>'
    rails = "".join(
        f'<joint name="{axis}" type="slide" axis="{way}" range="-1 1"/>'
        for axis, way in (("along", "1 0 0"), ("across", "0 1 0"))
    )
    plain = arm_of(read_robot(six, DOWN)).forward(np.array(DOWN)).position
    change(six, ('<body name="base">', f'<body name="base">{rails}{lamp}'))
    held = {"fixed": {"along": 0.25, "across": -0.5}, "flange": "flange"}
    with pytest.raises(UserError, match=r"'swing' is ball.*robot\.without=\[lamp\]"):
        read_robot(six, DOWN, **held)
    robot = read_robot(six, DOWN, without=["lamp"], **held)
    moved = arm_of(robot).forward(np.array(DOWN)).position
    np.testing.assert_allclose(moved - plain, (0.25, -0.5, 0.0), atol=1e-6)


def test_missing_meshes_of_mjcf_are_named_in_one_go(six):
    assets = '<asset><mesh name="a" file="a.stl"/><mesh name="b" file="b.obj"/></asset>'
    geoms = '<geom type="mesh" mesh="a"/><geom type="mesh" mesh="b"/>'
    change(
        six,
        ("<worldbody>", f"{assets}<worldbody>"),
        ("<site ", f"{geoms}<site "),
    )
    with pytest.raises(
        UserError, match=r"mesh files that are missing: .*/a\.stl, .*/b\.obj"
    ):
        read_robot(six, HOME)


STRAIGHT = (' ref="20"', "")
"""The arm without a reference angle, so that its home is that of the URDF."""


def add_mesh(six, named):
    """Let the arm have a mesh, in a folder beside its file."""
    (six.parent / "meshes").mkdir()
    trimesh.creation.box((0.04, 0.04, 0.04)).export(six.parent / "meshes/link.stl")
    asset = f'<asset><mesh name="a" file="{named}"/></asset>'
    change(
        six,
        STRAIGHT,
        ("<compiler ", '<compiler meshdir="meshes" '),
        ("<worldbody>", f"{asset}<worldbody>"),
        ("<site ", '<geom type="mesh" mesh="a"/><site '),
    )


@pytest.mark.parametrize("named", ["Link.STL", "meshes\\link.stl"])
def test_a_mesh_of_mjcf_that_is_nearly_where_the_file_says(six, caplog, named):
    add_mesh(six, named)
    read_robot(six, HOME)
    assert "1 meshes are not where the file says" in caplog.text


def test_a_model_that_is_attached_has_its_own_meshes(six, tmp_path):
    """Each attached model may name another folder of meshes."""
    add_mesh(six, "link.stl")
    (tmp_path / "scenes").mkdir()
    file = tmp_path / "scenes/scene.xml"
    file.write_text(
        '<mujoco><asset><model name="six" file="../six.xml"/></asset><worldbody>'
        '<body name="table"><geom size="0.1"/><attach model="six" body="base" prefix="a_"/></body>'
        "</worldbody></mujoco>"
    )
    assert read_robot(file, HOME).arm_joints[0] == "a_turn_1"


def test_two_joints_of_one_body_are_two_links(six, caplog):
    # The third joint turns the fourth's body, too.
    joint = '<joint name="turn 3" axis="0 1 0"/>'
    fourth = '<joint name="turn 4"'
    change(six, STRAIGHT, (joint, ""), (fourth, f"{joint}{fourth}"))
    robot = read_robot(six, HOME)
    assert "'arm/link 4:1', between two joints of a body, gets 1% of its mass" in (
        caplog.text
    )
    assert mass_of(robot) == pytest.approx(3 + 6 * 0.8, rel=1e-6)


def test_a_file_of_mjcf_is_found_from_the_folder_where_one_types(
    six, monkeypatch, capsys
):
    monkeypatch.chdir(six.parent)
    printed = said(capsys, f"robot.path={six.name}", "at=[0.5,0,0.4]")
    assert "tools are bolted to 'flange'" in printed


def test_what_hangs_on_a_ball_is_not_turned(six):
    from plugins.robots.mjcf import read_mjcf_arm

    ball = (
        '<body name="bob" pos="0.3 0 0.1"><joint name="ball" type="ball" range="0 1"/>'
        '<geom size="0.02" mass="0.1" rgba="0 0 0 0"/></body>'
    )
    change(six, ('<body name="base">', f'<body name="base">{ball}'))
    description, *_ = read_mjcf_arm(six, ())
    joint = description.joints["bob"]
    assert joint.origin.xyz == (0.3, 0.0, 0.1)
    assert not any(joint.origin.rpy)
    (collision,) = description.links["bob"].collisions
    assert collision.color[3] == 1.0


def test_one_joint_is_no_arm(tmp_path):
    file = tmp_path / "one.xml"
    file.write_text(
        '<mujoco><worldbody><body name="link"><joint range="-3 3" axis="0 0 1"/>'
        '<geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0" mass="1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(UserError, match=r"1 joint moves between base .*; an arm has 2"):
        take(["robot=urdf", f"robot.path={file}", "robot.effort=40"])


def test_an_arm_of_mjcf_without_motors_asks_for_efforts(six):
    six.write_text(mjcf(motors=False))
    with pytest.raises(
        UserError, match=r"'turn 1' has no effort limit.*robot\.effort="
    ):
        read_robot(six, HOME)
    robot = read_robot(six, DOWN, effort=40, velocity=[1, 1, 1, 2, 2, 2])
    assert robot.acceleration_limits == (2, 2, 2, 4, 4, 4)
    with pytest.raises(
        UserError, match=r"robot\.velocity has 2 numbers for 6 joints: turn 1"
    ):
        read_robot(six, DOWN, effort=40, velocity=[1, 2])


# --- names ----------------------------------------------------------------------------------------------------------


def test_names_of_the_file_stay_the_words_to_type(package, capsys):
    """Slashes, spaces, letters beyond ASCII, and names that the program needs itself."""
    change(
        package,
        ('"base_link"', '"arm 1/base_link"'),
        ('"turret"', '"Drehkörper"'),
        ('"joint_2"', '"left_finger"'),
        ('"hand"', '"tool_mount"'),
        ('"joint_3"', '"a/b"'),
        ('"joint_4"', '"a b"'),
    )
    printed = said(capsys, f"robot.path={package}", "robot.flange=tool_mount")
    assert "6 names are others here, such as 'arm_1_base_link'" in printed
    assert "borne by joint_1, left_finger, a/b, a b, joint_5" in printed
    robot = read_robot(package, HOME, "tool_mount")
    assert robot.mount_link == "tool_mount_2"
    assert robot.arm_joints[1:4] == ("left_finger_2", "a_b", "a_b_2")
    assert len({solid.name for solid in robot_solids(robot, False)}) == 7
    assert read_robot(package, HOME, "tool0").arm_joints == robot.arm_joints
    with pytest.raises(UserError, match=r"home has 1 numbers for 6 joints: .*a/b, a b"):
        read_robot(package, [0.0], "tool0")


# --- which link bears tools -----------------------------------------------------------------------------------------


def jaw(joint, link, kind="revolute", limits=(-0.1, 1.7)):
    """The changes that put a gripper of one moving jaw where tool0 is."""
    lower, upper = limits
    inertia = '<inertial><mass value="0.05"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5"/></inertial>'
    return (
        ('<link name="tool0"/>', f'<link name="{link}">{inertia}</link>'),
        (
            '<joint name="tool0_fixed" type="fixed">',
            f'<joint name="{joint}" type="{kind}">',
        ),
        (
            '<child link="tool0"/>',
            f'<child link="{link}"/><axis xyz="1 0 0"/>'
            f'<limit lower="{lower}" upper="{upper}" effort="3" velocity="3"/>',
        ),
    )


@pytest.mark.parametrize(
    ("change_of", "reason"),
    [
        (jaw("grip", "jaw"), "by its name"),
        (jaw("6", "Moving_Claw"), "by its name"),
        (jaw("joint_7", "link_7", "prismatic", (0, 0.03)), "is prismatic"),
        (jaw("joint_7", "link_7"), "opens from about 0 by 1.8 rad"),
    ],
)
def test_a_jaw_is_no_flange(package, capsys, change_of, reason):
    change(package, *change_of)
    link = change_of[0][1].split('"')[1]
    with pytest.raises(UserError, match=reason) as caught:
        take(["robot=urdf", f"robot.path={package}"])
    answers = str(caught.value)
    assert f"robot.flange=hand robot.without=[{link}]" in answers
    assert f"robot.flange={link}" in answers
    printed = said(
        capsys, f"robot.path={package}", "robot.flange=hand", f"robot.without=[{link}]"
    )
    assert "the flange 'hand'" in printed


def test_a_last_link_that_turns_is_said_with_the_other_answer(package, capsys):
    change(package, *jaw("joint_7", "link_7", limits=(-1.5, 1.5)))
    printed = said(capsys, f"robot.path={package}")
    assert "if it is a gripper's jaw, robot.flange=hand robot.without=[link_7]" in (
        printed
    )


def test_a_joint_without_limits_is_no_jaw(package):
    change(
        package, ('<limit lower="-2.9" upper="2.9" effort="30" velocity="4.0"/>', "")
    )
    with pytest.raises(UserError, match=r"joint 'joint_6' can't move: .*give <limit"):
        take(["robot=urdf", f"robot.path={package}"])


def test_a_wrist_is_a_flange_and_is_said(file, capsys):
    assert "tools are bolted to 'tool0', as no other" in said(
        capsys, f"robot.path={file}"
    )


# --- incomplete files -----------------------------------------------------------------------------------------------


def without(urdf, tag):
    """Remove all elements of a kind."""
    text = urdf.read_text()
    while f"<{tag}>" in text:
        before, _, rest = text.partition(f"<{tag}>")
        text = before + rest.partition(f"</{tag}>")[2]
    urdf.write_text(text)
    return urdf


def test_a_total_mass_is_spread_over_hulls(package):
    without(package, "inertial")
    with pytest.raises(
        UserError, match=r"'turret' moves, but has no mass; .*robot\.mass_kg=KG"
    ):
        read_robot(package, HOME, FLANGE)
    robot = read_robot(package, HOME, FLANGE, mass_kg=27.0)
    assert mass_of(robot) == pytest.approx(27.0)
    volumes = {
        solid.name: np.prod(solid.bounds()[1]) for solid in robot_solids(robot, False)
    }
    turret = robot.description.links["turret"].inertial
    hand = robot.description.links["hand"].inertial
    # Of two upright cylinders; the hull of the upper arm has its axle, too.
    assert turret.mass / hand.mass == pytest.approx(
        volumes["turret"] / volumes["hand"], rel=0.01
    )
    across = turret.mass * (3 * 0.07**2 + 0.15**2) / 12
    assert turret.tensor[0, 0] == pytest.approx(across, rel=0.01)


def test_inertias_of_links_without_mass_say_nothing(package):
    text = re.sub(r'<mass value="[^"]*"/>', '<mass value="0"/>', package.read_text())
    package.write_text(text)
    robot = read_robot(package, HOME, FLANGE, mass_kg=27.0)
    assert mass_of(robot) == pytest.approx(27.0)


def test_masses_of_the_file_stay(package):
    change(package, ('<mass value="0.172"/>', '<mass value="0"/>'))
    given = read_robot(
        package, [*HOME[:5]], "wrist_pitch", without=["hand"], mount_rpy=(0, 3.1416, 0)
    )
    hand = '<link name="hand">'
    before, _, after = package.read_text().partition(f"{hand}<inertial>")
    package.write_text(before + hand + after.partition("</inertial>")[2])
    robot = read_robot(package, HOME, FLANGE, mass_kg=mass_of(given) + 0.5)
    assert robot.description.links["hand"].inertial.mass == pytest.approx(0.5)
    with pytest.raises(
        UserError, match=r"mass_kg=1 is for the whole arm, but .* already"
    ):
        read_robot(package, HOME, FLANGE, mass_kg=1)


def test_an_arm_collides_as_it_is_drawn(package):
    without(package, "collision")
    with pytest.raises(
        UserError, match=r"no collision shape; .*robot\.collision=visual"
    ):
        read_robot(package, HOME, FLANGE)
    robot = read_robot(package, HOME, FLANGE, collision="visual")
    assert len(robot_solids(robot, False)) == 7
    without(package, "inertial")
    heavy = read_robot(package, HOME, FLANGE, collision="visual", mass_kg=20)
    assert mass_of(heavy) == pytest.approx(20.0)


# --- meshes that are not there --------------------------------------------------------------------------------------


def test_what_only_a_picture_needs_is_a_note(package, caplog):
    drawn, _, solid = package.read_text().rpartition("wrist_pitch.obj")
    drawn = replaced_all(drawn, ("wrist_pitch.obj", "nice.obj"))
    package.write_text(f"{drawn}wrist_pitch.obj{solid}")
    robot = read_robot(package, HOME, FLANGE)
    assert len(robot_solids(robot, False)) == 7
    missing = "not drawn: link 'wrist_pitch': visual: there is no mesh file"
    assert missing in caplog.text


def test_a_drawn_mesh_of_an_unknown_kind_is_a_note(package, caplog):
    (package.parents[1] / "meshes/hand.wrl").write_text("#VRML V2.0 utf8")
    mesh = "package://outside_arm/meshes/hand."
    change(
        package,
        (
            f'<visual><geometry><mesh filename="{mesh}stl"',
            f'<visual><geometry><mesh filename="{mesh}wrl"',
        ),
    )
    read_robot(package, HOME, FLANGE)
    assert "not drawn: mesh" in caplog.text


def test_all_that_is_missing_is_named_at_once(package):
    shutil.rmtree(package.parents[1] / "meshes")
    with pytest.raises(UserError) as caught:
        read_robot(package, HOME, FLANGE)
    for link, mesh in (
        ("base_link", "base.stl"),
        ("turret", "turret.obj"),
        ("hand", package.parents[2] / "outside_arm/meshes/hand.stl"),
    ):
        assert f"link '{link}': collision: there is no mesh file" in str(caught.value)
        assert str(mesh) in str(caught.value)


@pytest.mark.parametrize(
    "named",
    [
        "../meshes/BASE.STL",
        "..\\meshes\\base.stl",
        "package://somewhere_else/meshes/base.stl",
        "/home/somebody/ws/src/outside_arm/meshes/base.stl",
        "file:///C:/ws/outside_arm/Meshes/base.stl",
    ],
)
def test_a_mesh_that_is_nearly_where_the_file_says(package, named, caplog):
    whole = read_robot(package, HOME, FLANGE)
    change(package, ("../meshes/base.stl", named))
    near = read_robot(package, HOME, FLANGE)
    assert near.description.links["base_link"] == whole.description.links["base_link"]
    if "\\" not in named:
        assert re.search(r"meshes are not where the file says.*base\.stl", caplog.text)


def test_structure_is_checked_before_meshes(package):
    """A mesh that is no mesh is not looked at while a limit is missing."""
    (package.parents[1] / "meshes/base.stl").write_text("no mesh")
    limits = ('effort="150" velocity="2.6"', 'effort="150"')
    with pytest.raises(UserError, match="velocity limit") as caught:
        read_robot(change(package, limits), HOME, FLANGE)
    assert "base.stl" not in str(caught.value)


# --- files of other kinds -------------------------------------------------------------------------------------------

XACRO = (
    '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="x"><xacro:arg name="prefix"/>'
    '<xacro:arg name="speed" default="1"/><link name="$(arg prefix)base"/></robot>'
)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("arm.urdf", XACRO, r"is Xacro, .*xacrodoc .*arm\.urdf -o arm_plain\.urdf; with NAME:=VALUE .*-d FOLDER"),
        ("arm.urdf.xacro", XACRO, r"is Xacro, .*xacrodoc .* -o arm\.urdf_plain\.urdf; "),
        ("arm.urdf", '<sdf version="1.9"><model name="a"/></sdf>', r"is SDF, .*sdf2mjcf .*arm\.urdf arm\.xml"),
        ("arm.xml", "<mujocoinclude/>", "is a part of an MJCF model; give the file that includes it"),
        ("arm.urdf", "version https://git-lfs.github.com/spec/v1", "Git LFS; fetch the file: git lfs pull"),
        ("arm.urdf", "\n<!DOCTYPE html><html></html>", "is a web page; download the file itself"),
        ("arm.urdf", "<gazebo/>", r"is no URDF or MJCF: its root is <gazebo>"),
        ("arm.urdf", "<mujoco><worldbody/></mujoco>", "no joint moves in this MJCF file"),
        ("arm.urdf", '<mujoco><worldbody><body mass="1"/></worldbody></mujoco>', "is refused by MuJoCo"),
    ],
)  # fmt: skip
def test_a_file_is_what_its_content_says(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=message) as caught:
        read_robot(tmp_path / name, HOME)
    assert "\n" not in str(caught.value)


def test_a_zip_says_how_it_is_unpacked(package, tmp_path):
    with zipfile.ZipFile(tmp_path / "arm.zip", "w") as archive:
        archive.write(package, "outside_arm/urdf/arm.urdf")
    with pytest.raises(
        UserError,
        match=r"zip archive; unpack it: unzip .*arm\.zip -d arm, then name a file in arm",
    ):
        read_robot(tmp_path / "arm.zip", HOME)


def test_a_urdf_that_xacro_made_is_a_urdf(package):
    """It keeps Xacro's namespace; its name may be any."""
    change(package, ("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" '))
    package.rename(package.with_suffix(".xacro"))
    assert read_robot(package.with_suffix(".xacro"), HOME, FLANGE).title


# --- mounts and small arms ------------------------------------------------------------------------------------------


def small(urdf, forward, last=2.5):
    """An arm of four joints, whose last link leads on along an axis, 0.1 m, as the one before, 0.12 m."""
    inertia = '<inertial><mass value="0.3"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3"/></inertial>'
    long, short = (np.array(forward) * length for length in (0.12, 0.05))
    half = " ".join(map(str, short))
    shape = f'<collision><origin xyz="{half}"/><geometry><sphere radius="0.03"/></geometry></collision>'
    names = ("base", "turret", "upper", "fore", "hand")
    text = "".join(f'<link name="{name}">{inertia}{shape}</link>' for name in names)
    way = " ".join(map(str, long))
    places = ("0 0 0.08", "0 0 0.02", way, way)
    for number, place in enumerate(places):
        axis = "0 1 0" if number else "0 0 1"
        most = last if number == 3 else 2.5
        text += (
            f'<joint name="j{number}" type="revolute"><origin xyz="{place}"/><parent link="{names[number]}"/>'
            f'<child link="{names[number + 1]}"/><axis xyz="{axis}"/>'
            f'<limit lower="-{most}" upper="{most}" effort="5" velocity="3"/></joint>'
        )
    urdf.write_text(f'<robot name="small">{text}</robot>')
    return urdf


@pytest.mark.parametrize("forward", [(1, 0, 0), (0, 0, 1)])
def test_a_mount_is_found_for_four_joints(tmp_path, capsys, forward):
    urdf = small(tmp_path / "small.urdf", forward)
    joints, rpy = words_of(said(capsys, f"robot.path={urdf}", "at=[0.2,0,0.05]"))
    if forward[0]:
        assert rpy == "robot.mount_rpy=[0,-1.5708,0]"
    robot = read_robot(urdf, numbers_of(joints), mount_rpy=numbers_of(rpy))
    arm = arm_of(robot)
    at_home = arm.forward(arm.home)
    np.testing.assert_allclose(at_home.rotation.as_matrix(), np.eye(3), atol=1e-3)
    np.testing.assert_allclose(at_home.position, (0.2, 0.0, 0.05), atol=2e-3)


def test_remedies_are_for_what_is_missed(tmp_path):
    urdf = small(tmp_path / "small.urdf", (1, 0, 0))
    with pytest.raises(
        UserError, match=r"0\.\d+ m and .*nearer to the arm, or place the arm elsewhere"
    ):
        take(["robot=urdf", f"robot.path={urdf}", "at=[0.5,0,0.5]"])
    # The last joint hardly moves: what it bears looks down only where the arm can't be.
    small(urdf, (1, 0, 0), last=0.3)
    words = ["robot=urdf", f"robot.path={urdf}", "robot.flange=hand", "at=[0.2,0,0.1]"]
    remedy = r"the place is reached, the direction is not; .*robot\.mount_rpy="
    with pytest.raises(UserError, match=remedy):
        take(words)


def test_a_small_arm_is_enlarged_for_tasks(tmp_path, capsys, caplog):
    urdf = small(tmp_path / "small.urdf", (1, 0, 0))
    printed = said(capsys, f"robot.path={urdf}")
    joints, rpy, reach = words_of(printed)
    metres = numbers_of(reach)
    assert 0.15 <= metres < 0.5
    angles = numbers_of(joints)
    turned = numbers_of(rpy)
    plain = read_robot(urdf, angles, mount_rpy=turned)
    robot = read_robot(urdf, angles, mount_rpy=turned, reach=metres)
    k = 0.8 / metres
    assert f"simulated {k:.3g} times as large" in caplog.text
    assert f"{k:.3g} times as large" in robot.title
    arm = arm_of(robot)
    arm.home_for(Pose.xyz_rpy((0.5, 0.0, 0.5)))
    away = np.array([0.2, 0.1, -0.3, 0.4])
    np.testing.assert_allclose(
        arm.forward(away).position, k * arm_of(plain).forward(away).position, atol=1e-9
    )
    again = said(capsys, f"robot.path={urdf}", reach)
    assert "is at (0.5, 0, 0.5)" in again


def test_an_arm_that_is_enlarged_moves_as_it_does_itself(file):
    """Weights turn its joints as much faster as its torques do: all is in proportion."""
    plain = read_robot(file, HOME, FLANGE)
    robot = read_robot(file, HOME, FLANGE, reach=0.4)
    joints = np.array([0.3, 0.7, 1.2, 0.4, 0.9, 0.1])
    weights = [
        pin.rnea(*model_of(each), joints, *np.zeros((2, 6))) for each in (plain, robot)
    ]
    np.testing.assert_allclose(weights[1], 16 * weights[0], rtol=1e-6, atol=1e-9)
    inertias = [np.triu(pin.crba(*model_of(each), joints)) for each in (plain, robot)]
    np.testing.assert_allclose(inertias[1], 32 * inertias[0], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(
        arm_of(robot).effort_limits, 16 * arm_of(plain).effort_limits
    )
    np.testing.assert_allclose(robot.motor_inertia, 32 * np.array(plain.motor_inertia))
    np.testing.assert_allclose(
        arm_of(robot).velocity_limits, arm_of(plain).velocity_limits / np.sqrt(2)
    )
    assert robot.payload_kg == 8.0
    halves = [
        sum(solid.bounds()[1].max() for solid in robot_solids(each, False))
        for each in (plain, robot)
    ]
    assert halves[1] == pytest.approx(2 * halves[0], rel=1e-6)
    with pytest.raises(UserError, match=r"must be from 0\.05 to 0\.8 m, got 1\.2"):
        read_robot(file, HOME, FLANGE, reach=1.2)


def model_of(robot):
    model = pin.buildModelFromXML(write(robot.description))
    return model, model.createData()


# --- what is hardly meant -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ([('lower="-2.9" upper="2.9"', 'lower="-166" upper="166"')], "'joint_6' ranges over 332 rad; degrees?"),
        ([('velocity="2.6"', 'velocity="150"')], "turns at up to 150 rad/s; degrees?"),
        ([('<mass value="0.172"/>', '<mass value="1e-6"/>')], "link 'hand' weighs 1e-06 kg; grams?"),
        ([('xyz="0 0 0.05"', 'xyz="0 0 50"')], "link 'tool0' is 50 m from the one before; millimetres?"),
        ([('xyz="0 0 0.05"', 'xyz="0 0 0.05" rpy="0 0 44"')], "link 'tool0' is turned by 44 rad; degrees?"),
        ([('"-2.9" upper="2.9" effort="30"', '"-0.05" upper="0.05" effort="30"')], "'joint_6' ranges over 0.1 rad;"),
        ([('effort="30"', 'effort="30000"')], "'joint_6' bears up to 3e+04 N m; newton millimetres?"),
        ([('<mass value="0.172"/>', '<mass value="172"/>')], "link 'hand' has 8.98e+05 kg/m^3"),
        ([('effort="30"', 'effort="300"')], "'joint_6', a wrist, bears up to 300 N m, as a shoulder does"),
        ([('<mass value="0.172"/>', '<mass value="1.72e-5"/>')], "link 'hand' turns as if its mass were"),
    ],
)  # fmt: skip
def test_units_that_were_mixed_up_are_said(package, caplog, changes, line):
    read_robot(change(package, *changes), HOME, FLANGE)
    assert line in caplog.text
