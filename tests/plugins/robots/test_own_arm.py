import contextlib
import copy
import os
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core.design import Tool
from core.errors import UsageError, UserError
from core.geometry import Pose
from core.robot.kinematics import arm_of, link_frames
from core.robot.solids import robot_solids
from core.values.robots import ISO_9409_1_50, Robot
from plugins.robots.arm_settings import BoltOptions, GripperOptions
from plugins.robots.own_arm import read_robot
from tests.support.hands import gripped
from tests.support.outside_arm import FLANGE, HOME, LIMIT
from tests.support.text import replaced_all

pytestmark = pytest.mark.usefixtures("in_this_process")


@pytest.fixture
def changed(file):
    """Write the arm's URDF with parts of its text replaced, and read it."""

    def read(*changes, home=HOME, flange=FLANGE, name="changed.urdf", **options):
        text = replaced_all(file.read_text(), *changes)
        (file.parent / name).write_text(text)
        return read_robot(file.parent / name, home, flange, **options)

    return read


# --- what is read ---------------------------------------------------------------------------------------------------


def test_the_arm_is_as_the_file_has_it(file):
    robot = read_robot(file, HOME, FLANGE)
    assert (robot.name, robot.title) == ("outside arm", "outside arm")
    assert robot.arm_joints == tuple(f"joint_{n}" for n in range(1, 7))
    assert robot.acceleration_limits == (5.2, 5.2, 5.2, 8.0, 8.0, 8.0)
    assert robot.near_mount == ("hand", FLANGE)
    assert robot.gripper is None
    arm = arm_of(robot)
    np.testing.assert_allclose(arm.upper, LIMIT)
    above = arm.forward(arm.home)
    np.testing.assert_allclose(above.rotation.as_matrix(), np.eye(3), atol=0.01)
    reached = (
        0.42 * np.sin(0.35) + 0.40 * np.sin(1.85),
        0.35 + 0.42 * np.cos(0.35) + 0.40 * np.cos(1.85) - 0.12,
    )
    np.testing.assert_allclose(above.position, (reached[0], 0.0, reached[1]), atol=1e-3)
    assert arm.home_for(Pose.xyz_rpy((0.5, 0.0, 0.5))).shape == (6,)


def test_meshes_of_all_formats_and_units_have_their_size(file):
    robot = read_robot(file, HOME, FLANGE)
    half = {solid.name: solid.bounds()[1] for solid in robot_solids(robot, False)}
    assert len(half) == 7
    # Collada in centimetres.
    np.testing.assert_allclose(half["upper_arm"], (0.065, 0.06, 0.2125), atol=1e-3)
    # STL in millimetres, scaled.
    np.testing.assert_allclose(half["forearm"], (0.055, 0.06, 0.1325), atol=1e-3)


@pytest.mark.parametrize(
    "name",
    [
        "meshes/a.stl",
        "../meshes/base.stl",
        "file://{folder}/meshes/base.stl",
        "{folder}/meshes/base.stl",
    ],
)
def test_paths_of_meshes(changed, file, name):
    folder = file.parents[1]
    (file.parent / "meshes").mkdir(exist_ok=True)
    (file.parent / "meshes/a.stl").write_bytes(
        (folder / "meshes/base.stl").read_bytes()
    )
    assert changed(("../meshes/base.stl", name.format(folder=folder))).near_mount == (
        "hand",
        FLANGE,
    )


def test_packages_are_found_in_ros_paths(changed, file, monkeypatch, tmp_path):
    (tmp_path / "share/other_arm").mkdir(parents=True)
    (tmp_path / "share/other_arm/shapes").symlink_to(file.parents[1] / "meshes")
    change = ("package://outside_arm/meshes", "package://other_arm/shapes")
    with pytest.raises(
        UserError,
        match="package 'other_arm' must lie beside or above the URDF, or in a folder",
    ):
        changed(change)
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere{os.pathsep}{tmp_path}/share")
    changed(change)
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    changed(change)


def test_a_flange_that_is_the_only_end(file):
    assert read_robot(file, HOME) == read_robot(file, HOME, FLANGE)


def test_a_mount_turned_by_hand(changed):
    turned = (0.0, 0.35, 1.5, 0.0, 1.29, 0.785)
    with pytest.raises(
        UserError, match=r"45 degrees off the world's; .*robot.mount_rpy=\[(.*)\]"
    ) as caught:
        changed(home=turned)
    rpy = [
        float(number)
        for number in str(caught.value).rpartition("[")[2].rstrip("]").split(",")
    ]
    robot = changed(home=turned, mount_rpy=rpy)
    at_home = arm_of(robot).forward(np.array(turned)).rotation.as_matrix()
    np.testing.assert_allclose(at_home, np.eye(3), atol=1e-3)


def test_continuous_joints_turn_twice_at_most(changed):
    first = '"joint_1" type="revolute"'
    robot = changed((first, replaced_all(first, ("revolute", "continuous"))))
    np.testing.assert_allclose(arm_of(robot).upper, [2 * np.pi, *[LIMIT] * 5])


def test_an_inertia_counts_where_the_link_moves(changed):
    """The hand has no mass; the flange that is fixed to it has it, 5 cm farther on."""
    robot = changed(
        ('<link name="tool0"/>', _HEAVY),
        ('<mass value="0.172"/>', '<mass value="0"/>'),
    )
    inertial = robot.description.links["hand"].inertial
    assert inertial.mass == 0.5
    assert inertial.center[2] == 0.05


_HEAVY = '<link name="tool0"><inertial><mass value="0.5"/><inertia ixx="1e-3" iyy="1e-3" izz="1e-3"/></inertial></link>'


def test_rounded_inertias_are_mended(changed):
    moments = 'ixx="0.00500" iyy="0.00500" izz="0.01002"'
    robot = changed(('<link name="tool0"/>', _HEAVY), (_INERTIA, moments))
    x, _, _, y, _, z = robot.description.links["hand"].inertial.moments
    assert x + y >= z


_INERTIA = 'ixx="1e-3" iyy="1e-3" izz="1e-3"'


def test_bolts_of_the_flange(file):
    robot = read_robot(
        file, HOME, FLANGE, bolts=BoltOptions(0.04, 6, "M5", 0.0, 0.05, None)
    )
    assert (robot.flange.bolts, robot.flange.thread, robot.flange.disc.radius) == (
        6,
        "M5",
        0.025,
    )
    assert read_robot(file, HOME, FLANGE).flange == ISO_9409_1_50
    with pytest.raises(UsageError, match="circle_m < disc_m"):
        read_robot(file, HOME, FLANGE, bolts=BoltOptions(circle_m=50))


def test_a_gripper(changed):
    robot = changed(*gripped(), gripper=GripperOptions("hand_base", ("left", "right")))
    gripper = robot.gripper
    assert (gripper.links, gripper.travel_m, gripper.force_n) == (
        ("finger_r", "finger_l"),  # the first one is at -y, as Franka's is
        0.03,
        25.0,
    )
    rigid = arm_of(robot).forward(np.array(HOME))
    held = link_frames(
        robot, Tool(gripper=True), np.array([HOME]), np.full((1, 2), 0.03)
    )
    rotation, position = (values[0] for values in held["tool_mount"])
    np.testing.assert_allclose(position, rigid.position, atol=1e-9)
    np.testing.assert_allclose(rotation, rigid.rotation.as_matrix(), atol=1e-9)
    fingers = held["left_finger"][1] - held["right_finger"][1]
    np.testing.assert_allclose(np.abs(fingers), [[0.0, 0.06, 0.0]], atol=1e-9)
    assert {solid.name for solid in robot_solids(robot, True)} > {
        "left_finger",
        "right_finger",
        "hand_base",
    }
    assert "hand_base" not in {solid.name for solid in robot_solids(robot, False)}


def test_what_moves_beside_the_arm_is_held_or_left_out(changed):
    with pytest.raises(
        UserError,
        match=r"'left' is prismatic, 'right' is prismatic, .*fixed={left:0.0,right:0.0}.*=\[finger_l,finger_r\]",
    ):
        changed(*gripped())
    assert len(changed(*gripped(), fixed=["left", "right"]).arm_joints) == 6
    bare = changed(*gripped(), without=["hand_base"])
    assert not any("finger" in link for link in bare.description.links)
    assert (
        changed(fixed=["joint_4"], home=[*HOME[:3], *HOME[4:]]).arm_joints[3]
        == "joint_5"
    )


def test_a_joint_is_held_at_a_value(changed):
    """The other joints bring the flange where all of them would."""
    whole = changed(home=[0.3, *HOME[1:]])
    held = changed(fixed={"joint_1": 0.3}, home=HOME[1:])
    assert held.arm_joints == whole.arm_joints[1:]
    turned = np.array([0.1, 0.5, 0.2, 0.4, 0.1])
    there = link_frames(held, Tool(), turned[None], np.zeros((1, 0)))["hand"]
    for one, other in zip(
        there,
        link_frames(whole, Tool(), np.r_[0.3, turned][None], np.zeros((1, 0)))["hand"],
        strict=True,
    ):
        np.testing.assert_allclose(one, other, atol=1e-9)


# --- what is refused ------------------------------------------------------------------------------------------------

WRONG = yaml.safe_load(Path(__file__).with_name("wrong_arms.yaml").read_text())


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_named_in_one_line(changed, name):
    wrong = WRONG[name]
    changes = (
        gripped(**wrong["gripped"]) if "gripped" in wrong else wrong.get("changes", ())
    )
    gripper = (
        {"gripper": GripperOptions("hand_base", ("left", "right"))}
        if "gripper" in wrong
        else {}
    )
    with pytest.raises(UserError, match=wrong["message"]) as caught:
        changed(*changes, **gripper, **wrong.get("options", {}))
    assert "\n" not in str(caught.value)


def test_no_collision_shape(changed, file):
    text = file.read_text()
    shapes = {
        line.split("<collision>")[1].split("</collision>")[0]
        for line in text.splitlines()
        if "<collision>" in line
    }
    with pytest.raises(
        UserError,
        match=r"the arm has no collision shape; .* repeat each <visual> as <collision>",
    ):
        changed(*((f"<collision>{shape}</collision>", "") for shape in shapes))


def test_a_flange_that_looks_up(changed):
    with pytest.raises(
        UserError,
        match=r"the link before 'joint_6' is 0\.111 m below flange 'tool0', which looks up",
    ):
        changed(home=(0.0,) * 6)


def test_no_file(tmp_path):
    with pytest.raises(UserError, match=r"none.urdf can't be read: No such file"):
        read_robot(tmp_path / "none.urdf", HOME)


# --- anything -------------------------------------------------------------------------------------------------------

TEXTS = [
    "",
    " ",
    "nan",
    "inf",
    "-1",
    "0",
    "0 0 0",
    "1e-320",
    "1e300",
    "hand",
    "base_link",
    "fixed",
    "floating",
    "a" * 500,
]
TEXTS += [
    "continuous",
    "package://",
    "package://outside_arm",
    "../..",
    "file:///dev/zero",
    "\x7f",
    "1 2",
    "world",
    "é",
]


@pytest.mark.thorough
@pytest.mark.slow
@settings(
    max_examples=80,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_any_mutation_gives_an_arm_or_one_line(file, tmp_path, data):
    root = ElementTree.fromstring(file.read_text())
    for _ in range(data.draw(st.integers(1, 3))):
        elements = list(root.iter())
        element = data.draw(st.sampled_from(elements))
        match data.draw(st.sampled_from(["text", "delete", "remove", "repeat", "tag"])):
            case "text" if element.attrib:
                element.set(
                    data.draw(st.sampled_from(sorted(element.attrib))),
                    data.draw(st.sampled_from(TEXTS)),
                )
            case "delete" if element.attrib:
                del element.attrib[data.draw(st.sampled_from(sorted(element.attrib)))]
            case "remove" if len(element):
                element.remove(data.draw(st.sampled_from(list(element))))
            case "repeat" if len(element):
                element.append(copy.deepcopy(data.draw(st.sampled_from(list(element)))))
            case "tag":
                element.tag = data.draw(
                    st.sampled_from(
                        ["link", "joint", "mesh", "robot", "box", "limit", "mimic"]
                    )
                )
    mutant = file.parent / "mutant.urdf"
    mutant.write_bytes(ElementTree.tostring(root))
    with contextlib.suppress(UserError):
        robot = read_robot(mutant, HOME, FLANGE)
        assert isinstance(robot, Robot)
        assert np.isfinite(arm_of(robot).forward(np.array(robot.home)).position).all()
        robot_solids(robot, False)
