"""The reward of LidAndBall."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Trace
from tasks.hardtoolbench.lid_and_ball import (
    BALL_RADIUS,
    BOWL_RADIUS,
    LID_THICKNESS,
    POT_RADIUS,
    WALL,
    LidAndBall,
)

TASK = LidAndBall()
SCENE = TASK.scene(0)
START = SCENE.complete(SCENE.state())
POT = START.position("pot")
BOWL = START.position("bowl")
ASIDE = POT + np.array([0.0, 0.28, LID_THICKNESS / 2])


def reward(
    lid=ASIDE,
    ball=BOWL,
    fall=0.1,
    held=False,
    slides=0.0,
):
    """The reward of a lid and a ball that end elsewhere, after the lid fell at most so fast and slides."""
    velocities = np.array([[slides, 0.0, 0.0], [0.0, 0.0, 0.0]])
    end = replace(START, positions=np.stack([lid, ball]), linear_velocities=velocities)
    falling = replace(
        START, linear_velocities=np.array([[0.0, 0.0, -fall], [0.0, 0.0, 0.0]])
    )
    touching = {
        ("tool", "cradle", "ball"): np.array([False, True, held]),
        ("tool", "hook", "lid"): np.ones(3, bool),
    }
    return float(
        TASK.reward(START, end, Trace.of(START, falling, end, touching=touching))
    )


def test_both_count():
    assert reward() == 1.0
    assert reward(ball=START.position("ball")) == pytest.approx(0.25)
    assert reward(lid=START.position("lid")) == 0.0


@pytest.mark.parametrize(
    "off", [(0.0, 0.0, 0.04), (BOWL_RADIUS + BALL_RADIUS + WALL, 0.0, BALL_RADIUS)]
)
def test_a_ball_held_over_the_bowl_in_it_or_left_beside_it_is_not_in_it(
    off,
):
    assert 0.4 < reward(ball=BOWL + np.array(off)) <= 0.5 + 1e-9
    assert reward(held=True) == pytest.approx(0.5)


def test_the_reward_rises_on_the_ball_s_way():
    out = POT + np.array([0.0, -POT_RADIUS - 0.01, 0.0])
    rewards = [
        reward(ball=out + share * (BOWL - out)) for share in np.linspace(0.0, 1.0, 11)
    ]
    assert (np.diff(rewards) >= 0).all()
    assert rewards[-1] == 1.0


@pytest.mark.parametrize(
    ("case", "most"),
    [
        pytest.param({"fall": 1.2}, 0.0, id="the lid was dropped"),
        pytest.param({"slides": 0.3}, 0.0, id="the lid still slides"),
        pytest.param(
            {"lid": ASIDE + np.array([0.0, 0.0, 0.1])}, 0.0, id="the lid is held"
        ),
        pytest.param(
            {"lid": POT + np.array([0.1, 0.0, 0.1])}, 0.0, id="the lid was pushed aside"
        ),
        pytest.param(
            {"lid": ASIDE - np.array([0.0, 0.0, 0.6])},
            0.0,
            id="the lid is on the floor",
        ),
    ],
)
def test_what_earns_nothing(case, most):
    assert reward(**case) <= most  # type: ignore[arg-type]


@pytest.mark.parametrize(("height", "earned"), [(0.008, 1.0), (0.033, 0.0)])
@pytest.mark.parametrize("late", [0.001, 0.012, 0.025, 0.039])
def test_a_fall_that_ends_between_two_instants_is_as_fast_as_it_was(
    height, earned, late
):
    """From 33 mm the lid is 0.8 m/s fast where it lands, and up to 0.39 m/s slower at the last instant before."""
    times = np.arange(-3, 6) / 25 + late
    z = np.maximum(height - 9.81 * np.maximum(times, 0.0) ** 2 / 2, 0.0)
    ends = np.sqrt(2 * height / 9.81)
    speeds = np.where(times < ends, 9.81 * np.maximum(times, 0.0), 0.0)
    states = [
        replace(
            START,
            positions=np.stack([ASIDE + np.array([0.0, 0.0, up]), BOWL]),
            linear_velocities=np.array([[0.0, 0.0, -speed], [0.0, 0.0, 0.0]]),
        )
        for up, speed in zip(z, speeds, strict=True)
    ]
    trace = Trace.of(*states, touching={("tool", "hook", "lid"): times < 0})
    assert float(TASK.reward(START, states[-1], trace)) == pytest.approx(
        earned, abs=0.02
    )
