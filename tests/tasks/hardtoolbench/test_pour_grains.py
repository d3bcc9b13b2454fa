"""Requirements for PourGrains' reward."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import Trace
from tasks.hardtoolbench.pour_grains import BOWL_HEIGHT, BOWL_RADIUS, GRAINS, PourGrains

TASK = PourGrains(variation="wide")
SCENE = TASK.scene(3)
START = SCENE.state()


def reward(count, at=(0.0, 0.0, 0.02), speed=0.0, touching=False, more=()):
    """The reward when some of the grains end at a place in the bowl's frame."""
    positions = START.positions.copy()
    velocities = START.linear_velocities.copy()
    for name in GRAINS[:count]:
        index = START.names.index(name)
        positions[index] = SCENE["bowl"].pose.position + np.array(at)
        velocities[index] = (0.0, 0.0, speed)
    end = replace(START, positions=positions, linear_velocities=velocities)
    flags = {("body", "crucible", "bowl"): np.array([False, touching])}
    flags |= dict.fromkeys(more, np.array([False, True]))
    return float(TASK.reward(START, end, Trace.of(START, end, touching=flags)))


def test_each_grain_in_the_bowl_counts_the_same():
    assert [reward(count) for count in (0, 5, len(GRAINS))] == pytest.approx(
        [0.0, 5 / len(GRAINS), 1.0]
    )


@pytest.mark.parametrize(
    "at",
    [
        (BOWL_RADIUS + 0.02, 0.0, 0.01),
        (0.0, 0.0, BOWL_HEIGHT + 0.02),
        (0.3, 0.0, 0.007),
    ],
)
def test_grains_beside_the_bowl_above_it_or_on_the_table_earn_nothing(at):
    assert reward(len(GRAINS), at) == 0.0


def test_grains_in_motion_do_not_count():
    assert reward(len(GRAINS), speed=0.3) == 0.0


def test_grains_that_the_robot_still_carries_do_not_count():
    """They hang in the bowl, in the crucible that the tool holds there, or on the tool itself."""
    in_crucible = [("body", "crucible", name) for name in GRAINS]
    on_tool = ("tool", "ladle", GRAINS[0])
    in_bowl = [("body", name, "bowl") for name in GRAINS]
    assert reward(len(GRAINS), more=[*in_crucible, ("tool", "rack", "crucible")]) == 0.0
    assert reward(len(GRAINS), more=[on_tool, ("body", *GRAINS[:2])]) == pytest.approx(
        1 - 2 / len(GRAINS)
    )
    assert reward(len(GRAINS), more=[on_tool, *in_bowl]) == 1.0


def test_grains_in_a_crucible_that_rests_on_others_in_the_bowl_do_not_count():
    """They touch what touches the bowl, so that they are not held."""
    positions = START.positions.copy()
    positions[START.names.index("crucible")] = SCENE["bowl"].pose.position + np.array(
        [0.0, 0.0, 0.02]
    )
    for name in GRAINS:
        under = name in GRAINS[:3]
        positions[START.names.index(name)] = SCENE["bowl"].pose.position + np.array(
            [0.0, 0.0, 0.012 if under else 0.033]
        )
    end = replace(START, positions=positions)
    touching = [
        *(("body", name, "bowl") for name in GRAINS[:3]),
        *(("body", "crucible", name) for name in GRAINS),
    ]
    flags = dict.fromkeys(
        [*touching, ("tool", "rack", "crucible")], np.array([False, True])
    )
    assert float(
        TASK.reward(START, end, Trace.of(START, end, touching=flags))
    ) == pytest.approx(3 / len(GRAINS))


def test_nothing_counts_while_the_crucible_touches_the_bowl():
    assert reward(len(GRAINS), touching=True) == 0.0
