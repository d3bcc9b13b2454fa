import numpy as np
import pytest

from core.config.compose import load
from tests.benchmarks.floor import AWAY_M, DIRECTIONS, attempts, row


def test_the_row_has_the_best_direction_and_both_figures_of_random_tools():
    rewards = {"down 0": 0.1, "down 1": 0.3, "sweep 0 0": 0.9, "sweep 0 1": 0.0, "sweep 1 0": 0.6, "sweep 1 1": 0.6}
    assert row("A", rewards | {"random 0": 0.0, "random 1": 0.8}) == "| A | 0.200 | 0.600 | 0.400 | 0.800 |"


def test_attempts_are_tools_that_the_protocol_allows():
    cfg = load("evaluate", ["protocol=varied", "task=OneBook", "protocol.layouts=2"])
    made = dict(attempts(cfg, 4))
    keys = [key for key, _ in made]
    assert len([key for key in keys if key.startswith("sweep")]) == 2 * DIRECTIONS
    tools = {key: of for (key, _), of in made.items() if key.startswith("random")}
    assert len(tools) == 4
    assert all(0 < of.tool.mass <= 0.7 for of in tools.values())
    assert [of.plan.action for of in tools.values()] == ["waypoints", "anchored"] * 2
    assert dict(attempts(cfg, 4))["random 3", 1].content == made["random 3", 1].content
    assert np.ptp(made["sweep 0 1", 1].plan.poses[1:, 0]) == pytest.approx(2 * AWAY_M)
