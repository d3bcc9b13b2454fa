"""``vlmgineer import``: joints at which the flange of one's own arm looks down, or all that is wrong."""

import numpy as np
import pytest

from core.errors import UsageError, UserError
from core.robot.kinematics import arm_of
from plugins.robots.example_robots import robots_folder
from plugins.robots.own_arm import read_robot
from tests.plugins.robots.conftest import take
from tests.support.outside_arm import FLANGE, HOME
from tests.support.text import replaced, replaced_all

pytestmark = pytest.mark.usefixtures("in_this_process")


def found(capsys):
    """The home that was printed."""
    (line,) = [
        line
        for line in capsys.readouterr().out.splitlines()
        if line.startswith("robot.home=")
    ]
    return [
        float(number)
        for number in line.removeprefix("robot.home=[").rstrip("]").split(",")
    ]


@pytest.mark.parametrize(
    ("base", "at"),
    [((0, 0, 0, 0), (0.5, 0.0, 0.5)), ((0.1, -0.2, 0.1, 1.0), (0.4, 0.2, 0.45))],
)
def test_joints_are_found_and_the_arm_takes_them(file, capsys, base, at):
    take(
        [
            "robot=urdf",
            f"robot.path={file}",
            f"robot.base={list(base)}",
            f"at={list(at)}",
        ]
    )
    robot = read_robot(file, found(capsys), FLANGE)
    there = arm_of(robot).forward(np.array(robot.home))
    turned = np.array(
        [
            [np.cos(base[3]), -np.sin(base[3]), 0],
            [np.sin(base[3]), np.cos(base[3]), 0],
            [0, 0, 1],
        ]
    )
    np.testing.assert_allclose(turned @ there.position + base[:3], at, atol=2e-3)
    np.testing.assert_allclose(there.rotation.as_matrix(), np.eye(3), atol=1e-3)


def test_all_that_is_wrong_is_said_at_once(file):
    text = replaced(
        replaced_all(file.read_text(), ('velocity="2.6"', 'velocity="0"')),
        ('effort="40" ', ""),
    )
    (file.parent / "wrong.urdf").write_text(
        replaced_all(text, ('<mass value="0.172"/>', '<mass value="0"/>'))
    )
    with pytest.raises(UserError) as caught:
        take(["robot=urdf", f"robot.path={file.parent / 'wrong.urdf'}"])
    lines = str(caught.value).splitlines()
    for joint in (1, 2, 3):
        assert (
            sum(
                f"joint 'joint_{joint}' has 0 as velocity limit" in line
                for line in lines
            )
            == 1
        )
    assert (
        "- joint 'joint_4' has no effort limit; take it from the arm's data sheet, N m: "
        "robot.effort=[...], a number for each joint or one for all" in lines
    )
    assert lines[-1].startswith(
        "- link 'hand' with what is fixed to it (1 more) moves, but has no mass"
    )


def test_out_of_reach(file):
    with pytest.raises(
        UserError,
        match=r"no joints bring the flange to \(2, 0, 0.5\).* misses it by 1\.\d+ m",
    ):
        take(["robot=urdf", f"robot.path={file}", "at=[2,0,0.5]"])


def test_a_joint_that_blocks_is_named(file):
    """The elbow's range is too small for a place so near."""
    elbow = 'name="joint_3" type="revolute">'
    before, after = file.read_text().split(elbow)
    tight = replaced(after, ('lower="-2.9" upper="2.9"', 'lower="-0.1" upper="0.3"'))
    (file.parent / "tight.urdf").write_text(f"{before}{elbow}{tight}")
    with pytest.raises(
        UserError,
        match=r"misses it by 0\.\d+ m and \d+ degrees, with .*'joint_3'.* at the limit; choose",
    ):
        take(
            ["robot=urdf", f"robot.path={file.parent / 'tight.urdf'}", "at=[0.3,0,0.4]"]
        )


def test_a_frame_inside_the_last_link(file, capsys):
    """The arm looks down whatever the last link's frame is, and is told where its face is."""
    take(["robot=urdf", f"robot.path={file}", "robot.flange=hand"])
    printed = capsys.readouterr().out
    assert "its shape reaches 50 mm beyond" in printed
    assert "robot.face_m=0.0500" in printed
    take(["robot=urdf", f"robot.path={file}", f"robot.flange={FLANGE}"])
    assert "beyond" not in capsys.readouterr().out
    take(["robot=urdf", f"robot.path={file}", "robot.flange=hand", "robot.face_m=0.05"])
    assert "beyond" not in capsys.readouterr().out
    face = arm_of(read_robot(file, HOME, "hand", face_m=0.05))
    frame = arm_of(read_robot(file, HOME, FLANGE))
    np.testing.assert_allclose(
        face.forward(np.array(HOME)).matrix,
        frame.forward(np.array(HOME)).matrix,
        atol=1e-9,
    )


def test_what_hangs_where_tools_go_is_named(file, capsys):
    box = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    joint = '<joint name="on" type="fixed"><parent link="tool0"/><child link="lamp"/></joint>'
    hung = f'<link name="lamp">{box}</link>{joint}'
    (file.parent / "lamp.urdf").write_text(
        replaced_all(file.read_text(), ("</robot>", f"{hung}</robot>"))
    )
    take(
        [
            "robot=urdf",
            f"robot.path={file.parent / 'lamp.urdf'}",
            f"robot.flange={FLANGE}",
        ]
    )
    assert (
        "lamp hang where tools go; leave out robot.without=[lamp]"
        in capsys.readouterr().out
    )


ARMS = {
    "baxter_description/urdf/baxter.urdf": (
        "robot.flange=left_hand_link robot.without=[head,right_upper_shoulder,left_gripper_base_link] at=[0.7,0.3,0.5]",
        ("which link bears tools.*left_hand_link", "'right_w2'|right_s0"),
        7,
    ),
    "tiago_description/robots/tiago.urdf": (
        "robot.flange=arm_tool_link at=[0.6,0,0.9] "
        "robot.without=[wheel_right_link,wheel_left_link,head_1_link,hand_tool_link,wrist_ft_link]",
        ("which link bears tools.*arm_tool_link", "'wheel_right_joint' is continuous"),
        8,  # its lift slides
    ),
}


@pytest.mark.thorough
@pytest.mark.parametrize("name", ARMS)
def test_an_arm_of_a_robot_with_more_joints(name, capsys, monkeypatch):
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(robots_folder().parent))
    words, errors, count = ARMS[name]
    chosen = ["robot=urdf", f"robot.path={robots_folder() / name}"]
    for more, error in zip(([], words.split()[:1]), errors, strict=True):
        with pytest.raises(UserError, match=error):
            take([*chosen, *more])
    take([*chosen, *words.split()])
    assert len(found(capsys)) == count


def test_other_arms_have_a_home():
    with pytest.raises(UsageError, match="robot=panda is built in"):
        take([])
