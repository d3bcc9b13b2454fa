"""The rewards of LiftBox and ElevatePlate, whose body is lifted straight up."""

from dataclasses import replace

import numpy as np
import pytest

from core.scene import State
from tasks import elevate_plate, lift_box

LIFTED = {
    "box": (
        lift_box.LiftBox(),
        lift_box.CENTER,
        lift_box.WANTED_HEIGHT - lift_box.CENTER[2],
    ),
    "plate": (elevate_plate.ElevatePlate(), elevate_plate.START, elevate_plate.LIFT),
}
every_body = pytest.mark.parametrize(
    ("task", "begin", "rise"), LIFTED.values(), ids=LIFTED
)


def moved(task, begin, *way):
    """The start state with the body shifted from where it begins."""
    return replace(task.scene(0).state(), positions=np.add([begin], way))


@every_body
def test_the_reward_rises_in_step_with_the_body(task, begin, rise):
    start = moved(task, begin, 0, 0, 0)
    lifted = [moved(task, begin, 0, 0, share * rise) for share in np.linspace(0, 1, 11)]
    assert task.scene(0).state().positions == pytest.approx(start.positions, abs=1e-3)
    rewards = np.array([task.reward(start, end) for end in lifted])
    assert rewards == pytest.approx(np.linspace(0, 1, 11))
    assert task.reward(State.stack([start] * 11), State.stack(lifted)) == pytest.approx(
        rewards
    )


@every_body
def test_the_reward_counts_from_where_the_body_settled(task, begin, rise):
    """The plate's goal sinks with it, the box's height is the table's."""
    settled = moved(task, begin, 0.01, 0.0, -0.002)
    goal = rise - (0.002 if task.name == "ElevatePlate" else 0.0)
    assert task.reward(settled, settled) == 0.0
    assert task.reward(settled, moved(task, begin, 0.01, 0.0, goal)) == pytest.approx(
        1.0
    )
