"""Tools that a plugin builds in Python keep the rules that a model's keep."""

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.designs.reading import read_designs
from core.designs.rules import given_tool
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import EvolutionStrategy, GivenTools
from core.plugins import Offer, installed
from core.search.orchestration import run
from tasks.bring_cube import BringCube
from tests.support import toys
from tests.support.panda import on_panda


def rod(z=-0.1, mass=0.005, length=0.2):
    return Tool(
        (
            Component(
                "rod",
                "tool_mount",
                Pose.xyz_rpy((0, 0, z)),
                Box((0.02, 0.02, length)),
                mass,
            ),
        )
    )


class Given(GivenTools):
    def given(self, task):
        return self.tool


class Builder(EvolutionStrategy):
    """Builds two sound tools and one that floats; no designer is asked."""

    def ask(self):
        plan = np.array([[0.5, 0.0, 0.5, 0.0, 0.0, 0.0]])
        for number, z in enumerate((-0.1, -0.1, -0.4)):
            yield Candidate(rod(z), plan, 0, 0, number)

    def tell(self, evaluations):
        pass


@pytest.fixture
def play(tmp_path, monkeypatch):
    """Run with toys and with one part of a package."""

    def play(kind, part, *words):
        offers = toys.offered() | {
            (kind, "mine"): Offer(kind, "mine", "shoddy", "shoddy-parts", part)
        }
        for key, offer in offers.items():
            monkeypatch.setitem(installed().offers, key, offer)
        return run(
            toys.config(tmp_path / "notes", f"{kind}=mine", *words), tmp_path / "run"
        )

    return play


@pytest.mark.parametrize(
    ("tool", "reason"),
    [
        (
            rod(z=-0.4),
            "component 'rod' is 295.0 mm away from its mount 'tool_mount'; move it by (0, 0, 0.295) m",
        ),
        (rod(mass=50.0), "component 'rod' weighs 50 kg"),
        ("a rod", "given returned \"'a rod'\"; expected a Tool or None"),
    ],
)
def test_a_given_tool_that_breaks_a_rule_ends_the_command(play, tmp_path, tool, reason):
    part = type("Mine", (Given,), {"tool": tool})
    with pytest.raises(UserError) as error:
        play("tool", part, "material=paper")  # by which it weighs what it says
    line = str(error.value)
    assert line.startswith(
        "tool 'mine' of shoddy-parts (hook 'tool_representations'): "
    )
    assert reason in line
    assert "\n" not in line
    assert not (tmp_path / "run").exists()
    with pytest.raises(UserError, match=r"expected a Tool|breaks a rule"):
        read_designs(
            {"strategies": [{"action_sets": [[]]}]}, part(), on_panda(BringCube())
        )


def test_a_given_tool_that_starts_inside_something_is_rejected_where_it_is_tried(play):
    part = type("Mine", (Given,), {"tool": rod(z=-0.35, length=0.7)})
    result = play("tool", part)
    tried = [
        e
        for generation in result.generations
        for e in generation.evaluations
        if e.trials
    ]
    assert len(tried) > 5
    assert {(e.status, e.reward) for e in tried} == {("rejected", 0.0)}
    assert {e.reason for e in tried} == {tried[0].reason}
    assert tried[0].reason.startswith(
        "component 'rod' starts 200.0 mm inside 'table' of the scene"
    )


def test_given_tools_that_keep_the_rules_are_given():
    for tool in (rod(), Tool(), Tool(gripper=True)):
        part = type("Mine", (Given,), {"tool": tool})()
        assert given_tool(part, on_panda(BringCube())) is tool


def test_a_tool_that_a_strategy_builds_is_checked(play):
    result = play("evolution", Builder, "budget.n_iteration=0")
    evaluations = result.generations[0].evaluations
    assert [e.status == "rejected" for e in evaluations] == [False, False, True]
    line = "evolution 'mine' of shoddy-parts (hook 'evolution_strategies') built a wrong tool: component 'rod' is 295.0"
    assert evaluations[2].reason.startswith(line)
