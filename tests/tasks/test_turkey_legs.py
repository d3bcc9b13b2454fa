"""The reward and the layouts of TurkeyLegs."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Pose
from core.scene import State
from tasks.turkey_legs import (
    BOX,
    BOX_HEIGHT,
    BOX_WIDTH,
    LEGS,
    POT_HEIGHT,
    TurkeyLegs,
)

TASK = TurkeyLegs()
START = TASK.scene(0).state()
IN_THE_BOX = np.array([*BOX, 0.03])


def end(**moved):
    """The layout of seed 0 with some bodies elsewhere."""
    positions = START.positions.copy()
    for name, position in moved.items():
        positions[START.names.index(name)] = position
    return replace(START, positions=positions, quaternions=START.quaternions.copy())


def rewards(ends):
    return TASK.reward(State.stack([START] * len(ends)), State.stack(ends))


def test_the_reward_rises_from_0_to_1_leg_by_leg():
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


def test_with_the_pot_dropped_along_it_is_0_7():
    everything = dict.fromkeys((*LEGS, "pot"), IN_THE_BOX)
    assert rewards([end(**everything)])[0] == pytest.approx(0.7)


LEANS = Pose.xyz_rpy(
    (BOX[0] + 0.17, BOX[1] - 0.045, BOX_HEIGHT + 0.005), (2.0, 0.0, 0.0)
)


@pytest.mark.parametrize(
    ("pose", "inside"),
    [
        pytest.param(Pose(np.array([*BOX, 0.01])), True, id="stands in it"),
        pytest.param(
            Pose.xyz_rpy((*BOX, POT_HEIGHT + 0.01), (np.pi, 0.0, 0.0)),
            True,
            id="lies in it upside down",
        ),
        pytest.param(LEANS, True, id="leans in it with its bottom above the edge"),
        pytest.param(
            Pose.xyz_rpy((*BOX, BOX_HEIGHT + POT_HEIGHT + 0.01), (np.pi, 0.0, 0.0)),
            False,
            id="is held above",
        ),
        pytest.param(
            Pose.xyz_rpy((BOX[0], BOX[1] - 0.3, 0.15), (2.0, 0.0, 0.0)),
            False,
            id="is held beside it, tilted",
        ),
        pytest.param(
            Pose.xyz_rpy((BOX[0], BOX[1] - BOX_WIDTH / 2 - 0.13, 0.0)),
            False,
            id="stands beside it",
        ),
    ],
)
def test_the_pot_is_in_the_box_if_any_of_it_is(pose, inside):
    state = end(**dict.fromkeys(LEGS, IN_THE_BOX), pot=pose.position)
    state.quaternions[state.names.index("pot")] = pose.quaternion
    assert rewards([state, state]) == pytest.approx([0.7 if inside else 1.0] * 2)
