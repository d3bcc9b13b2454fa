from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Box, Cylinder, Pose
from core.interfaces import JointTrajectory, Rollout, Task
from core.robot.solids import Solid, body_solids, signed_distance, solid_geometry
from core.scene import Scene, State
from tasks.score_goal import HEIGHT, PUCK_HEIGHT, PUCK_RADIUS, START, ScoreGoal
from tests.engines import simulator
from tests.panda import ARM, on_panda

TASK = ScoreGoal()
SCENE = TASK.scene(0)
BEFORE = SCENE.state()
LYING = PUCK_HEIGHT / 2
GOAL = SCENE["goal"]
NETS = [part for part in GOAL.collisions if isinstance(part.shape, Box)]


def reward(*places):
    ends = [replace(BEFORE, positions=np.array([place], dtype=float)) for place in places]
    return TASK.reward(State.stack([BEFORE] * len(ends)), State.stack(ends)).tolist()


def gap(puck):
    """Metres between a puck, in the goal's frame, and the goal; negative: penetration of a bar or a net."""
    disc = Solid("puck", solid_geometry(Cylinder(PUCK_RADIUS, PUCK_HEIGHT)), GOAL.pose @ puck)
    return min(signed_distance(disc, part) for part in body_solids(GOAL))


def lying(x, y):
    """A puck on the ice, in the goal's frame."""
    return GOAL.pose.inverse() @ Pose.xyz_rpy((x, y, LYING))


@pytest.mark.parametrize("friction", ["puck", 0.5])
def test_what_slides_on_the_floor_slides_as_if_on_ice(friction):
    other = SCENE[friction].friction if isinstance(friction, str) else friction  # 0.5: tools
    assert np.sqrt(SCENE["floor"].friction * other) == pytest.approx(0.1)


def test_the_way_to_the_goal():
    way = np.subtract((2.0, 0.0, LYING), START)
    np.testing.assert_allclose(
        reward(*[np.add(START, share * way) for share in (0, 0.25, 0.5, 0.75, 0.95, 1)]), [0, 0.25, 0.5, 0.75, 1, 1]
    )


@pytest.mark.parametrize("x", [1.88, 2.0, 2.12])
@pytest.mark.parametrize("y", [-0.22, 0.0, 0.22])
@pytest.mark.parametrize("z", [LYING, 0.1, 0.3])
def test_anywhere_in_the_goal_is_a_goal(x, y, z):
    assert reward((x, y, z)) == [1]


@pytest.mark.parametrize(
    "place",
    [(1.86, 0, LYING), (2.14, 0, LYING), (2.0, 0.24, LYING), (2.0, -0.24, LYING), (2.1, 0.2, 0.34), (2.1, 0.2, -0.05)],
)
def test_next_to_it_above_it_or_below_it_the_horizontal_distance_counts(place):
    (earned,) = reward(place)
    assert earned < 0.95
    assert earned == pytest.approx(1 - np.hypot(place[0] - 2.0, place[1]) / np.hypot(1.2, 0.6))


@pytest.mark.parametrize("place", [(0.8, 0.8, LYING), (3.5, 0, LYING), (2.0, -1.5, LYING), (9, 9, -3)])
def test_a_puck_shot_past_or_the_wrong_way_earns_nothing(place):
    assert reward(place) == [0]


def test_the_mouth_is_open_and_the_rest_is_shut():
    assert all(gap(lying(x, y)) > 0 for x in np.linspace(1.7, 2.08, 20) for y in (-0.19, 0.0, 0.19))
    for inside, outside in [((2.0, 0), (2.3, 0)), ((2.0, 0), (2.0, 0.4)), ((2.0, 0), (2.0, -0.4))]:
        way = [np.add(inside, share * np.subtract(outside, inside)) for share in np.linspace(0, 1, 40)]
        assert min(gap(lying(*place)) for place in way) < 0
    assert min(gap(lying(1.85, y)) for y in (-0.2475, 0.2475)) < 0  # the posts


# --- shots ------------------------------------------------------------------------------------------------------


class Shot(Task):
    """A goal turned so that a direction in it points straight down, and a puck that falls as high as it takes to
    arrive at a point of the goal with a speed: gravity shoots, so that every engine can.
    """

    name = "Shot"
    description = ""
    goals = ()

    def __init__(self, aim, direction, speed, rpy):
        turn, _ = Rotation.align_vectors([[0.0, 0.0, -1.0]], [direction])
        self.goal = Pose.from_rotation(GOAL.pose.position - turn.as_matrix() @ aim, turn)
        self.puck = self.goal @ Pose.xyz_rpy(aim - direction * speed**2 / 2 / 9.81, rpy)

    def scene(self, seed):
        return Scene((replace(GOAL, pose=self.goal), replace(SCENE["puck"], pose=self.puck)))

    def reward(self, start, end):
        return np.zeros(start.positions.shape[:-2])


def flight(aim, direction, speed, rpy):
    """Positions (S, 3) of the puck in the goal's frame, at each step until 0.3 s after the expected hit."""
    task = on_panda(Shot(aim, direction / np.linalg.norm(direction), speed, rpy))
    still = JointTrajectory(np.zeros(1), ARM.home_for(task.home)[None], np.zeros(1))
    job = Rollout(Tool(), still, settle_s=0.0, hold_s=speed / 9.81 + 0.3, record_hz=500.0)
    (outcome,) = simulator("pybullet").rollout(task, [job])
    assert outcome.error is None
    places: np.ndarray = task.goal.inverse().apply(outcome.recording.states.position("puck"))
    return places


def through_nets(places):
    """The nets that a path (S, 3) in the goal's frame crosses."""
    passed = []
    for net in NETS:
        at = net.pose.inverse().apply(places)
        half = np.array(net.shape.size) / 2
        thin = int(np.argmin(half))
        for i in np.flatnonzero(at[:-1, thin] * at[1:, thin] < 0):
            share = at[i, thin] / (at[i, thin] - at[i + 1, thin])
            if (np.abs(at[i] + share * (at[i + 1] - at[i])) <= half).all():
                passed.append(net)
    return passed


def outward(net):
    """The direction of a net's outer face."""
    size = np.array(net.shape.size)
    return np.where(size == size.min(), np.sign(net.pose.position - (0.0, 0.0, HEIGHT / 2)), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("net", NETS, ids=["behind", "above", "right", "left"])
def test_no_shot_gets_through_the_net_with_the_flat_side_ahead(net):
    """The puck is thinnest that way. At each speed another of its steps meets the net."""
    across = np.abs(outward(net))
    flat = (across[1] * np.pi / 2, across[0] * np.pi / 2, 0.0)
    for speed in np.linspace(6.0, 8.0, 4):
        way = flight(net.pose.position, -outward(net), speed, flat)
        assert not through_nets(way), f"at {speed:.2f} m/s"
