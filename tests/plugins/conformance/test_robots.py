"""The checks of robots find what is wrong. The built-in ones pass them in `tests/plugins/robots/test_robots.py`."""

from dataclasses import replace
from pathlib import Path

import pytest

from core.imports.documents import read_xml
from core.imports.urdf import read_tree
from core.plugins import installed
from core.robot.writing import write
from plugins.conformance.suites import SUITES, examine
from tests.support.rare import rare
from tests.support.text import replaced_all

pytestmark = pytest.mark.slow


def ur5(**changes):
    return replace(installed().create("robot", "ur5"), **changes)


def rewritten(*changes):
    text = replaced_all(write(ur5().description), *changes)
    return ur5(description=read_tree(read_xml(text.encode(), Path("ur5"))))


def turned(joint, by):
    home = list(ur5().home)
    home[joint] += by
    return tuple(home)


WEAK = [(f'effort="{old}"', 'effort="0.5"') for old in (150, 28)]
WRONG = {
    "an endless joint": (
        lambda: rewritten(
            (
                'name="wrist_3_joint" type="revolute"',
                'name="wrist_3_joint" type="continuous"',
            )
        ),
        {
            "limits are there": "joint 'wrist_3_joint' is continuous; it must be revolute or prismatic, with limits"
        },
    ),
    "no torque": (
        lambda: rewritten(('effort="28"', 'effort="0"')),
        {"limits are there": "joint 'wrist_1_joint' can't move: "},
    ),
    "a mount askew": (
        lambda: ur5(home=turned(5, 0.1)),
        {
            "home points the mount down": "the turn of the mount at home from the base's axes, rad: 0.1; it must be"
        },
    ),
    "a home beyond the limits": (
        lambda: ur5(home=turned(0, 7.0)),
        {
            "home points the mount down": "home of 'shoulder_pan_joint' within its limits, rad: 6.78"
        },
    ),
    "the inertia of the wrist as ROS has it": (
        lambda: rewritten(
            ('ixx="0.00201389"', 'ixx="0.111172755531"'),
            ('iyy="0.0021942"', 'iyy="0.111172755531"'),
            ('izz="0.00201389"', 'izz="0.21942"'),
        ),
        {
            "inertias are physical": "'wrist_1_link' lies from the middle of its shapes on average, m: 0.4"
        },
    ),
    "an inertia of no body": (
        lambda: rewritten(('izz="0.004095"', 'izz="0.09"')),
        {
            "inertias are physical": "inertias 0.0312168, 0.0312168, 0.09 of 'forearm_link': no body has"
        },
    ),
    "a mass far away": (
        lambda: rewritten(('xyz="0 0.0912 0.01634"', 'xyz="0 0.9 0"')),
        {
            "inertias are physical": "lies from the middle of its shapes on average, m: 0.8"
        },
    ),
    "an outstretched arm": (
        lambda: ur5(home=(0.0, -1.5708, 0.0, -1.5708, -1e-4, 0.0)),
        {
            "straight lines are reached": "choose a home away from limits and from an outstretched arm"
        },
    ),
    "weak motors": (
        lambda: rewritten(*WEAK),
        {
            "every engine tracks a trajectory": "how far the arm is off its trajectory, rad: ",
            "every engine holds the arm at home": "the bare arm sags at home, rad: ",
        },
    ),
    "a payload of 200 kg": (
        lambda: ur5(payload_kg=200.0),
        {
            "every engine holds the arm at home": "the arm with 200 kg sags at home, rad: "
        },
    ),
}


@pytest.mark.parametrize("case", rare(WRONG, "an endless joint", "no torque"))
def test_what_is_wrong_is_reported(case):
    make, expected = WRONG[case]
    problems = {verdict.check: verdict.problem for verdict in examine("robot", make())}
    assert len(problems) == len(SUITES["robot"])
    for check, problem in expected.items():
        assert problems[check] is not None, check
        assert problem in problems[check]
