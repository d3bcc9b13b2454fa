"""Self-collision along joint trajectories, against Coal at dense samples, and what becomes of such plans."""

import itertools
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import JointTrajectory, RolloutSettings
from core.robot.description import assemble
from core.robot.solids import Solid, robot_solids, signed_distance, solid_geometry
from core.solids.self_collision import DEEP_M, DEEP_NEAR_M, find_self_collision
from tests.support.faults import Faulty, Slide
from tests.support.panda import ARM, FINGER_OPEN, PANDA
from tests.support.playing import evaluate_batch

ROD = Tool(
    (
        Component(
            "rod",
            "tool_mount",
            Pose.xyz_rpy((0, 0, -0.06)),
            Box((0.02, 0.02, 0.12)),
            0.1,
        ),
    )
)
# The elbow folds, and the forearm goes into the shoulder.
FOLDED = np.array([[0.4, 0, 0.4, 0, 0, 0], [0.22, 0.12, 0.22, 0, 0, 3.1]])


def moved(*waypoints, tool=None, times=None, fingers=None):
    """Targets that go through joint positions (7,), a second apart."""
    times = np.arange(len(waypoints), dtype=float) if times is None else np.array(times)
    fingers = (
        np.full(len(waypoints), FINGER_OPEN) if fingers is None else np.array(fingers)
    )
    return find_self_collision(
        PANDA,
        tool or Tool(),
        JointTrajectory(times, np.array(waypoints, dtype=float), fingers),
    )


# --- against dense samples --------------------------------------------------------------------------------------


@cache
def model(gripper):
    made = pin.buildModelFromXML(assemble(PANDA, Tool(gripper=gripper), visuals=False))
    links = {
        frame.name: frame for frame in made.frames if frame.type == pin.FrameType.BODY
    }
    return made, made.createData(), links


def depths(tool, joints, fingers):
    """The penetration depth of each two parts that may not meet, beyond what is allowed."""
    made, data, links = model(tool.gripper)
    pin.framesForwardKinematics(
        made, data, np.array([*joints, *[fingers] * (made.nq - 7)])
    )
    places = {
        name: Pose.from_matrix(data.oMf[made.getFrameId(name)].homogeneous)
        for name in links
    }
    placed = tool.placed()
    solids = [
        (s.name, s.name, Solid(s.name, s.geometry, places[s.name] @ s.pose))
        for s in robot_solids(PANDA, tool.gripper)
    ]
    for part in tool.components:
        mount, pose = placed[part.name]
        solids.append(
            (
                part.name,
                mount,
                Solid(part.name, solid_geometry(part.shape), places[mount] @ pose),
            )
        )
    hand = {"panda_hand", "left_finger", "right_finger"}
    number = {name: min(links[name].parentJoint, 7) for name in links}
    found = {}
    for (one, bearer, a), (other, others_bearer, b) in itertools.combinations(
        solids, 2
    ):
        apart = abs(number[bearer] - number[others_bearer])
        if one in placed or other in placed:
            same = links[bearer].parentJoint == links[others_bearer].parentJoint
            fingers_both = {bearer, others_bearer} == {"left_finger", "right_finger"}
            limit = None if same or fingers_both else DEEP_M
        elif {one, other} & hand:
            limit = None if apart < 2 else DEEP_NEAR_M if apart == 2 else DEEP_M
        else:
            limit = None if apart < 3 else DEEP_M
        if limit is not None:
            depth = -signed_distance(a, b) - limit
            found[frozenset((one, other))] = max(
                depth, found.get(frozenset((one, other)), -np.inf)
            )
    return found


def tools():
    """Bare arms and hands, and tools of one box that may reach back over the arm."""
    places = st.tuples(*[st.floats(-0.25, 0.25)] * 2, st.floats(-0.3, 0.3))
    sides = st.tuples(*[st.sampled_from([0.0005, 0.002, 0.02, 0.15])] * 3)
    boxes = st.builds(
        lambda at, size, mount: Tool(
            (Component("box", mount, Pose.xyz_rpy(at), Box(size)),),
            mount != "tool_mount",
        ),
        places,
        sides,
        st.sampled_from(["tool_mount", "left_finger"]),
    )
    return st.sampled_from([Tool(), Tool(gripper=True)]) | boxes


@pytest.mark.thorough
@settings(max_examples=25, deadline=None)
@given(tools(), st.lists(st.tuples(*[st.floats(0, 1)] * 8), min_size=2, max_size=3))
def test_it_finds_what_dense_samples_find(tool, shares):
    low, high = np.append(ARM.lower, 0.0), np.append(ARM.upper, FINGER_OPEN)
    path = low + np.array(shares) * (high - low)
    found = moved(*path[:, :7], tool=tool, fingers=path[:, 7])
    instants = np.linspace(0, len(path) - 1, 40 * (len(path) - 1) + 1)
    dense = [np.interp(instants, np.arange(len(path)), column) for column in path.T]
    seen = [depths(tool, q[:7], q[7]) for q in np.array(dense).T]
    if found is None:
        assert max(max(each.values()) for each in seen) < 0.001
        return
    here = np.array(
        [np.interp(found.time_s, np.arange(len(path)), column) for column in path.T]
    )
    assert depths(tool, here[:7], here[7])[frozenset((found.part, found.other))] > 0
    first = next(
        (
            t
            for t, each in zip(instants, seen, strict=True)
            if max(each.values()) > 0.001
        ),
        np.inf,
    )
    pair = frozenset((found.part, found.other))
    start = next(
        (t for t, each in zip(instants, seen, strict=True) if each[pair] > -0.001),
        found.time_s,
    )
    assert start <= first + 1 / 40  # the first two that meet are named


def test_a_sheet_that_passes_between_two_samples_is_found():
    """Half a millimetre thin, from one side of the forearm to the other in a hundredth of a second."""
    post = Component(
        "post", "tool_mount", Pose.xyz_rpy((0, 0.065, 0)), Box((0.02, 0.13, 0.01))
    )
    sheet = Component(
        "sheet", "tool_mount", Pose.xyz_rpy((0, 0.13, 0.15)), Box((0.0005, 0.02, 0.3))
    )
    tool = Tool((post, sheet))
    before, after = ARM.home.copy(), ARM.home.copy()
    before[6], after[6] = -2.0, 0.5
    assert moved(before, before, tool=tool) is None
    assert moved(after, after, tool=tool) is None
    found = moved(before, after, tool=tool, times=[0.0, 0.01])
    assert found is not None
    assert found.with_tool


# --- what counts ------------------------------------------------------------------------------------------------


def test_the_limits_of_two_joints_keep_links_apart():
    """A link that two joints bear is allowed all of their range: only the hulls overlap there."""
    low, high = ARM.lower, ARM.upper
    for wrist in np.linspace(low[5], high[5], 9):
        here, there = ARM.home.copy(), ARM.home.copy()
        here[5:], there[5:] = (wrist, low[6]), (wrist, high[6])
        assert moved(here, there) is None


def test_the_hand_may_not_go_into_the_forearm():
    back = ARM.home.copy()
    back[5:] = ARM.lower[5], -np.pi / 4
    found = moved(ARM.home, back, tool=Tool(gripper=True))
    assert {found.part, found.other} == {"panda_hand", "panda_link5"}


def halves(inner):
    """A plate on each finger, its inner face ``inner`` metres from the finger's."""
    return tuple(
        Component(
            f"plate_{side}",
            f"{side}_finger",
            Pose.xyz_rpy((0, y, 0.05)),
            Box((0.02, 0.01, 0.03)),
        )
        for side, y in (("left", 0.005 - inner), ("right", inner - 0.005))
    )


def test_fingers_close_until_their_plates_meet():
    """Commanded to close, plates may meet, as they do on a body between them."""
    tool = Tool(halves(0.01), gripper=True)
    assert moved(ARM.home, ARM.home, tool=tool, fingers=[FINGER_OPEN, 0.0]) is None


def test_a_finger_may_not_drive_its_tool_into_the_hand():
    arch = (
        Component(
            "arm", "left_finger", Pose.xyz_rpy((0, 0.05, 0.03)), Box((0.02, 0.1, 0.01))
        ),
        Component(
            "hook", "arm", Pose.xyz_rpy((0, 0.045, -0.05)), Box((0.02, 0.01, 0.1))
        ),
    )
    tool = Tool(arch, gripper=True)
    assert (
        moved(ARM.home, ARM.home, tool=tool, fingers=[FINGER_OPEN, FINGER_OPEN]) is None
    )
    found = moved(ARM.home, ARM.home, tool=tool, fingers=[FINGER_OPEN, 0.0])
    assert {found.part, found.other} == {"hook", "panda_hand"}
    assert found.with_tool


# --- what becomes of a plan -------------------------------------------------------------------------------------


class Unused(Faulty):
    def one(self, task, job):
        raise AssertionError("a rejected plan costs no rollout")


def test_the_setting_decides():
    def evaluated(penetration, sim):
        rules = RolloutSettings(settle_s=0, hold_s=0, penetration=penetration)
        return evaluate_batch(Slide(), sim, [Candidate(ROD, FOLDED)], settings=rules)[0]

    rejected = evaluated("forbid", Unused())
    assert (rejected.status, rejected.reward) == ("rejected", 0.0)
    assert "'panda_link1'" in rejected.reason
    assert "'panda_link5'" in rejected.reason
    assert "on the way to waypoint 2; move or turn this waypoint" in rejected.reason
    assert [refusal.code for refusal in rejected.refusals] == ["E_ARM_IN_ITSELF"]
    warned = evaluated("warn", Faulty())
    assert warned.status == "ok"
    assert [
        warning
        for warning in warned.warnings
        if "inside the arm's 'panda_link" in warning
    ]
    assert evaluated("ignore", Faulty()).warnings == ()
