import json

import numpy as np
import pytest

from core.config.compose import load, tool_part
from core.designs.planning import look
from core.designs.reading import read_designs
from core.designs.rules import SpawnRules
from core.interfaces import Perception
from core.plugins import installed
from tests.benchmarks.floor import DIRECTIONS
from tests.benchmarks.given import KINDS


@pytest.fixture
def floor(tmp_path):
    rewards = {f"sweep {number} {layout}": float(number == 3) for number in range(DIRECTIONS) for layout in range(2)}
    (tmp_path / "StopCart.json").write_text(json.dumps(rewards))
    return tmp_path


@pytest.mark.parametrize("what", KINDS)
def test_every_answer_is_one_design_that_may_be_tried(what, floor):
    task = installed().create("task", "StopCart", variation="wide")
    tool = tool_part(load("evaluate", [f"tool={'none' if what in ('bare', 'nothing') else 'boxes'}"])).create()
    document = {"strategies": [KINDS[what]("StopCart", floor)]}
    actions = installed().create("action", "anchored")
    (design,) = read_designs(document, tool, SpawnRules(task, 0), actions=actions)
    assert design.problem is None
    poses = [design.plan.resolve(look(task, seed, Perception())).poses for seed in (0, 1)]
    assert (what in ("anchored", "bare")) == (not np.allclose(*poses))


def test_a_literal_plan_keeps_its_tempo(floor):
    (reference,), (literal,) = (KINDS[what]("StopCart", floor)["action_sets"] for what in ("anchored", "literal"))
    assert [step.get("seconds") for step in literal] == [step.get("seconds") for step in reference]
    assert not any("anchor" in step for step in literal)
