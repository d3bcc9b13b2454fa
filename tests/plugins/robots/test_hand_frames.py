"""A hand is simulated as it stands in the file, and named by what its fingers do."""

import math

import numpy as np
import pytest

from core.errors import UserError
from core.robot.extents import fingers_of
from core.robot.kinematics import arm_of
from plugins.robots.arm_settings import GripperOptions
from plugins.robots.arms import panda
from plugins.robots.example_robots import robots_folder
from plugins.robots.own_arm import read_robot
from tests.plugins.robots.conftest import take
from tests.support.outside_arm import FLANGE, HOME
from tests.support.text import replaced_all

pytestmark = pytest.mark.usefixtures("in_this_process")
HAND = GripperOptions("palm", ("slide_a", "slide_b"))
# How the hand is turned in the flange, and its fingers in it, radians.
TURNS = (0.0, -math.pi / 4, math.pi / 2, math.pi, 0.3)
ROLLS = ("0 0 0", "0 0 1.5708", "1.5708 0 0.4", "3.14159 0.7 -2")


def _link(name, size, z, mass, rpy="0 0 0", xyz=None):
    """A box, in a frame that a finger's file may turn: what it fills stays where it is."""
    place = xyz or f"0 0 {z}"
    shape = (
        f'<origin xyz="{place}" rpy="{rpy}"/><geometry><box size="{size}"/></geometry>'
    )
    inertia = '<inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/>'
    return (
        f'<link name="{name}"><inertial><origin xyz="{place}"/><mass value="{mass}"/>{inertia}</inertial>'
        f"<visual>{shape}</visual><collision>{shape}</collision></link>"
    )


def _numbers(values):
    return " ".join(f"{value:.12g}" for value in values)


def write_hand(file, turn, roll="0 0 0", name="hand.urdf"):
    """Write the arm with a hand that is turned in the flange, and fingers whose frames are rolled."""
    from scipy.spatial.transform import Rotation

    rolled = Rotation.from_euler("xyz", [float(angle) for angle in roll.split()])
    back = rolled.inv()
    center = _numbers(back.apply((0.0, 0.0, 0.026)))
    angles = _numbers(back.as_euler("xyz"))
    parts = [_link("palm", "0.05 0.2 0.05", 0.026, 0.4)]
    parts.append(
        f'<joint name="palm_joint" type="fixed"><parent link="{FLANGE}"/><child link="palm"/>'
        f'<origin rpy="0 0 {turn}"/></joint>'
    )
    for side, way in (("a", 1), ("b", -1)):
        axis = _numbers(back.apply((0.0, way, 0.0)))
        parts.append(
            _link(f"finger_{side}", "0.02 0.016 0.05", 0.026, 0.02, angles, center)
        )
        parts.append(
            f'<joint name="slide_{side}" type="prismatic"><parent link="palm"/><child link="finger_{side}"/>'
            f'<origin xyz="0 {way * 0.008} 0.0512" rpy="{roll}"/><axis xyz="{axis}"/>'
            '<limit lower="0" upper="0.04" effort="60" velocity="0.2"/></joint>'
        )

    written = file.parent / name
    written.write_text(
        replaced_all(file.read_text(), ("</robot>", "".join(parts) + "</robot>"))
    )
    return written


@pytest.mark.parametrize("roll", ROLLS)
@pytest.mark.parametrize("turn", TURNS)
def test_however_the_file_turns_a_hand_its_fingers_are_the_same(file, turn, roll):
    robot = read_robot(write_hand(file, turn, roll), HOME, FLANGE, gripper=HAND)
    upright = arm_of(robot).forward(np.array(robot.home)).rotation.as_matrix()
    np.testing.assert_allclose(upright, np.eye(3), atol=2e-3)
    for finger, side in zip(fingers_of(robot), (-1, 1), strict=True):
        np.testing.assert_allclose(
            finger.pose.rotation_matrix, np.diag([1.0, -1.0, -1.0]), atol=1e-5
        )
        np.testing.assert_allclose(
            finger.pose.position, (0.0, side * 0.04, -0.0522), atol=1e-6
        )
        assert tuple(finger.opens) == (0.0, -side, 0.0)
        assert tuple(finger.tip) == (0.0, 0.0, 1.0)


def test_the_pandas_own_file_gives_the_frames_of_the_arm_that_is_built_in():
    file = robots_folder() / "panda_description/urdf/panda.urdf"
    built_in = panda()
    robot = read_robot(
        file,
        (*built_in.home[:6], 0.0),  # with the flange's axes, not the hand's, square
        "panda_link8",
        gripper=GripperOptions(
            "panda_hand", ("panda_finger_joint1", "panda_finger_joint2")
        ),
    )
    np.testing.assert_allclose(robot.home, built_in.home, atol=2e-3)
    np.testing.assert_allclose(
        robot.mount.rotation_matrix, built_in.mount.rotation_matrix, atol=1e-5
    )
    assert robot.gripper.joints == built_in.gripper.joints
    for own, known in zip(fingers_of(robot), fingers_of(built_in), strict=True):
        np.testing.assert_allclose(own.pose.position, known.pose.position, atol=1e-3)
        np.testing.assert_allclose(
            own.pose.rotation_matrix, known.pose.rotation_matrix, atol=1e-5
        )
        np.testing.assert_allclose(own.extent, known.extent, atol=1e-3)


@pytest.mark.parametrize(
    ("off", "said"), [(0.3, False), (0.4, True), (-0.4, True), (0.785, True)]
)
def test_a_home_that_leaves_the_hand_on_a_diagonal_is_turned_and_said(
    file, caplog, off, said
):
    robot = read_robot(write_hand(file, 0.0), (*HOME[:5], off), FLANGE, gripper=HAND)
    upright = arm_of(robot).forward(np.array(robot.home)).rotation.as_matrix()
    np.testing.assert_allclose(upright, np.eye(3), atol=2e-3)
    assert ("robot.home=[0,0.35,1.5,0,1.29,0] says so" in caplog.text) == said


def test_a_hand_that_no_joint_can_turn_square_is_refused(file):
    written = write_hand(file, -math.pi / 4)
    narrow = '-2.9" upper="2.9" effort="30"'
    text = written.read_text()
    assert narrow in text
    written.write_text(text.replace(narrow, '-0.1" upper="0.1" effort="30"'))
    with pytest.raises(UserError, match="45 degrees off the world's"):
        read_robot(written, HOME, FLANGE, gripper=HAND)


@pytest.mark.parametrize("turn", [0.0, -math.pi / 4])
def test_home_brings_the_hand_square(file, capsys, caplog, turn):
    written = write_hand(file, turn)
    words = "robot.gripper={link:palm,joints:[slide_a,slide_b]}"
    take(["robot=urdf", f"robot.path={written}", f"robot.flange={FLANGE}", words])
    lines = capsys.readouterr().out.splitlines()
    (line,) = [line for line in lines if line.startswith("robot.home=")]
    joints = [float(angle) for angle in line[len("robot.home=[") : -1].split(",")]

    robot = read_robot(written, joints, FLANGE, gripper=HAND)
    np.testing.assert_allclose(robot.home, joints, atol=5e-3)
    assert "diagonal" not in caplog.text
    assert "turned by" not in caplog.text


def test_bolts_stay_where_the_flange_has_them(file):
    """Seen from a mount that is turned by 45 degrees, bolts at 45 degrees are along its axes."""
    straight = read_robot(write_hand(file, 0.0), HOME, FLANGE, gripper=HAND)
    turned = read_robot(write_hand(file, -math.pi / 4), HOME, FLANGE, gripper=HAND)
    for robot in (straight, turned):
        (x, y, _) = robot.mount.rotation.apply(
            (math.cos(robot.flange.bolt_angle), math.sin(robot.flange.bolt_angle), 0.0)
        )
        assert abs(abs(x) - abs(y)) < 1e-5


def test_a_finger_that_touches_nothing_is_refused(file):
    written = write_hand(file, 0.0)
    head, _, tail = written.read_text().partition('<link name="finger_a">')
    shape, _, rest = tail.partition("</link>")
    before, _, behind = shape.partition("<collision>")
    written.write_text(
        f'{head}<link name="finger_a">{before}{behind.partition("</collision>")[2]}</link>{rest}'
    )
    with pytest.raises(UserError, match="finger 'finger_a' has no collision shape"):
        read_robot(written, HOME, FLANGE, gripper=HAND)
