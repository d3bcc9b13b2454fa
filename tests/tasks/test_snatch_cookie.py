"""The reward and the layouts of SnatchCookie."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory, Rollout
from core.plugins import installed
from core.scene import State
from tasks.snatch_cookie import BODY_RADIUS, BOTTOM, COOKIES, JAR, MOUTH, RADIUS, THICKNESS, SnatchCookie
from tests.panda import ARM, FINGER_OPEN, on_panda

TASK = on_panda(SnatchCookie())
START = TASK.scene(0).state()


def moved(name: str, position: Array) -> State:
    """The layout of seed 0 with one cookie elsewhere."""
    positions = START.positions.copy()
    positions[START.names.index(name)] = position
    return replace(START, positions=positions)


def lifted(name: str, to: float) -> list[State]:
    """The layout of seed 0 with one cookie raised to a height."""
    here = START.position(name)
    return [moved(name, np.array([here[0], here[1], z])) for z in np.linspace(here[2], to, 60)]


def rewards(ends: list[State]) -> Array:
    return TASK.reward(State.stack([START] * len(ends)), State.stack(ends))


@pytest.mark.parametrize("name", ["cookie_6", "cookie_12", "cookie_1"])
def test_the_reward_rises_from_0_to_1_while_a_cookie_is_lifted_out(name: str) -> None:
    reward = rewards(lifted(name, 0.31))
    assert reward[0] == 0.0
    assert reward[-1] == 1.0
    assert (np.diff(reward) >= 0).all()


def test_half_the_way_up_earns_half() -> None:
    rest = START.position("cookie_6")[2]
    end = lifted("cookie_6", (rest + 0.3) / 2)[-1]
    assert TASK.reward(START, end) == pytest.approx(0.5)


@pytest.mark.parametrize(
    "where",
    [
        pytest.param((JAR[0] - 0.045, 0.0, 0.06), id="pressed down"),
        pytest.param((0.4, 0.3, THICKNESS / 2), id="on the table"),
        pytest.param((2.0, 1.0, -0.6), id="flung to the floor"),
    ],
)
def test_a_cookie_that_ends_low_earns_nothing(where: tuple[float, float, float]) -> None:
    assert rewards([moved("cookie_6", np.array(where))])[0] == 0.0


@pytest.mark.parametrize("seed", range(10))
def test_cookies_lie_in_the_jar_and_in_nothing_else(seed: int) -> None:
    positions = TASK.scene(seed).state().positions
    assert len(positions) == COOKIES
    from_the_middle = np.linalg.norm(positions[:, :2] - JAR, axis=1) + RADIUS
    assert from_the_middle.max() < BODY_RADIUS
    assert positions[:, 2].min() - THICKNESS / 2 >= BOTTOM
    assert positions[:, 2].max() < MOUTH
    apart = np.abs(positions[:, None] - positions[None])
    clear = (np.linalg.norm(apart[..., :2], axis=-1) > 2 * RADIUS) | (apart[..., 2] > THICKNESS)
    assert clear[~np.eye(COOKIES, dtype=bool)].all()


@pytest.mark.thorough
def test_the_columns_stand_still() -> None:
    """Contact solvers are at their worst with stacks."""
    still = JointTrajectory(np.zeros(1), ARM.home_for(TASK.home)[None], np.array([FINGER_OPEN]))
    jobs = [Rollout(Tool(), still, seed, settle_s=0.5, hold_s=5.0) for seed in (5, 6, 7)]
    for outcome in installed().create("sim", "pybullet").rollout(TASK, jobs):
        assert outcome.start is not None
        assert outcome.end is not None
        assert np.linalg.norm(outcome.end.positions - outcome.start.positions, axis=-1).max() < 1.1e-3
