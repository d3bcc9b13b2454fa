"""The reward and the layouts of TurkeyLegs."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Array, Pose
from core.scene import State
from tasks.turkey_legs import (
    BONE_RADIUS,
    BONE_X,
    BOX,
    BOX_HEIGHT,
    BOX_WIDTH,
    KNOB_RADIUS,
    KNOB_X,
    LEGS,
    MEAT_RADIUS,
    MEAT_X,
    POT,
    POT_HEIGHT,
    POT_RADIUS,
    TurkeyLegs,
)

TASK = TurkeyLegs()
START = TASK.scene(0).state()
IN_THE_BOX = np.array([*BOX, 0.03])
SPHERES_X = np.array([*MEAT_X, *np.linspace(BONE_X, KNOB_X, 8), KNOB_X])  # a leg as a row of spheres
SPHERES_RADIUS = np.array([*MEAT_RADIUS, *[BONE_RADIUS] * 8, KNOB_RADIUS])


def end(**moved: Array) -> State:
    """The layout of seed 0 with some bodies elsewhere."""
    positions = START.positions.copy()
    for name, position in moved.items():
        positions[START.names.index(name)] = position
    return replace(START, positions=positions, quaternions=START.quaternions.copy())


def rewards(ends: list[State]) -> Array:
    return TASK.reward(State.stack([START] * len(ends)), State.stack(ends))


def test_the_reward_rises_from_0_to_1_leg_by_leg() -> None:
    ends = [
        end(**dict.fromkeys(LEGS[:done], IN_THE_BOX), **{LEGS[done]: here})
        for done in range(len(LEGS))
        for here in np.linspace(START.position(LEGS[done]), IN_THE_BOX, 20)
    ]
    reward = rewards(ends)
    assert reward[0] == 0.0
    assert reward[-1] == 1.0
    assert (np.diff(reward) >= 0).all()
    assert sorted(set(reward.round(6))) == [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]


def test_with_the_pot_dropped_along_it_is_0_7() -> None:
    everything = dict.fromkeys((*LEGS, "pot"), IN_THE_BOX)
    assert rewards([end(**everything)])[0] == pytest.approx(0.7)


LEANS = Pose.xyz_rpy((BOX[0] + 0.17, BOX[1] - 0.045, BOX_HEIGHT + 0.005), (2.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("pose", "inside"),
    [
        pytest.param(Pose(np.array([*BOX, 0.01])), True, id="stands in it"),
        pytest.param(Pose.xyz_rpy((*BOX, POT_HEIGHT + 0.01), (np.pi, 0.0, 0.0)), True, id="lies in it upside down"),
        pytest.param(LEANS, True, id="leans in it with its bottom above the edge"),
        pytest.param(
            Pose.xyz_rpy((*BOX, BOX_HEIGHT + POT_HEIGHT + 0.01), (np.pi, 0.0, 0.0)), False, id="is held above"
        ),
        pytest.param(
            Pose.xyz_rpy((BOX[0], BOX[1] - 0.3, 0.15), (2.0, 0.0, 0.0)), False, id="is held beside it, tilted"
        ),
        pytest.param(Pose(np.array([BOX[0], BOX[1] - BOX_WIDTH / 2 - 0.13, 0.0])), False, id="stands beside it"),
    ],
)
def test_the_pot_is_in_the_box_if_any_of_it_is(pose: Pose, inside: bool) -> None:
    state = end(**dict.fromkeys(LEGS, IN_THE_BOX), pot=pose.position)
    state.quaternions[state.names.index("pot")] = pose.quaternion
    assert rewards([state, state]) == pytest.approx([0.7 if inside else 1.0] * 2)


@pytest.mark.parametrize(
    "where",
    [
        pytest.param((BOX[0], BOX[1], BOX_HEIGHT + 0.01), id="above the box"),
        pytest.param((BOX[0], BOX[1] - BOX_WIDTH / 2 - 0.03, 0.02), id="beside the box"),
        pytest.param((3.0, 1.0, -0.6), id="flung off"),
        pytest.param((BOX[0], BOX[1], -0.6), id="on the floor below the table"),
    ],
)
def test_legs_outside_the_box_earn_nothing(where: tuple[float, float, float]) -> None:
    assert rewards([end(**dict.fromkeys(LEGS, np.array(where)))])[0] == 0.0


@pytest.mark.parametrize("seed", range(20))
def test_legs_lie_in_the_pot_and_not_in_each_other(seed: int) -> None:
    state = TASK.scene(seed).state()
    points = np.stack([SPHERES_X, *np.zeros((2, len(SPHERES_X)))], axis=-1)
    legs = np.array([state.pose(name).apply(points) for name in LEGS])
    from_the_middle = np.linalg.norm(legs[..., :2] - POT, axis=-1) + SPHERES_RADIUS
    assert from_the_middle.max() < POT_RADIUS - 0.002
    for i, one in enumerate(legs):
        for other in legs[i + 1 :]:
            apart = np.linalg.norm(one[:, None] - other[None], axis=-1)
            assert (apart - SPHERES_RADIUS[:, None] - SPHERES_RADIUS).min() > 0.002
