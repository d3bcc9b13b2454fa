"""Designs that earn something only if they can be made, borne and run."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.design import Candidate, Component, Fixture, Tool
from core.designs.composer import as_markdown
from core.designs.reading import read_designs
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import Condition, Waypoints
from core.plugins import PluginPart
from core.values.materials import Material
from plugins.commands.prompt import PromptConfig, compose
from plugins.fitness.nominal import Nominal
from plugins.vlms.context.feedback import describe
from tests.plugins.fitness.judging import judged

pytestmark = pytest.mark.slow

PLA = Material("pla", 1240, 0.2, 1.2, young_pa=2.5e9, strength_pa=26e6)
LARGE = {"plate_mm": [500.0, 500.0, 500.0]}


MOVE_BALL = Condition(PluginPart("task", "MoveBall"), PluginPart("sim", "mujoco"))


def fitness(**settings):
    chosen = {"name": "buildable", "material": vars(PLA), **settings}
    return part("fitness", OmegaConf.create(chosen)).create(condition=MOVE_BALL)


@pytest.fixture(scope="module")
def scoop():
    """The anchored solution of MoveBall, of PLA."""
    document = json.loads(Path("tests/tasks/anchored/MoveBall.json").read_text())
    boxes = PluginPart("tool", "boxes", material=PLA).create()
    (candidate,) = read_designs(document, boxes, MOVE_BALL.task.create())
    assert candidate.problem is None
    return candidate


def test_what_is_too_thin_costs_no_rollout_and_its_reason_names_the_wall(scoop):
    (found,) = judged(fitness(printer={"min_wall_mm": 30.0}), scoop)
    assert (found.status, found.reward) == ("rejected", 0.0)
    assert "held by a joint thinner than a wall" in found.reason
    assert "let components overlap by more than a wall" in describe(found)


def test_what_is_buildable_earns_what_the_other_fitness_says(scoop):
    (alone,) = judged(Nominal(MOVE_BALL), scoop)
    (found,) = judged(fitness(printer=LARGE), scoop)
    assert (found.status, found.reason) == ("ok", "")
    assert alone.reward - 0.02 < found.reward <= alone.reward
    assert found.figures["safety_factor"] > 2
    assert found.figures["clearance_m"] > 0.005
    assert " of all trials" not in describe(found)
    robust = {
        "name": "robust",
        "sims": ["mujoco"],
        "seeds": [4],
        "perturbation": {"position": 0.0001},
    }
    (found,) = judged(fitness(printer=LARGE, of=robust), scoop)
    assert list(found.by_engine) == ["mujoco"]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            {"safety": 20.0},
            r"not buildable: strength, \w+: .* at least 20 is asked for; ball loads it .* as thick",
        ),
        (
            {"margin_m": 0.19},
            r"not buildable: clearance: the arm comes as near as \d+ mm to (table|itself); at least 190",
        ),
    ],
)
def test_what_breaks_or_comes_too_near_earns_nothing_and_says_why(
    scoop, settings, said
):
    (found,) = judged(fitness(printer=LARGE, **settings), scoop)
    assert (found.status, found.reward) == ("ok", 0.0)
    assert re.match(said, found.reason), found.reason
    assert "so that its reward of 0.9" in found.reason


def test_neighbours_are_judged_each_for_itself(scoop):
    thin = Component(
        "wall",
        "tool_mount",
        Pose.xyz_rpy((0.0, 0.0, -0.05)),
        Box((0.0006, 0.1, 0.1)),
        0.01,
    )
    stay = Candidate(
        Tool((thin,)), Waypoints(np.array([[0.5, 0.0, 0.5, 0.0, 0.0, 0.0]])), action=1
    )
    unread = Candidate(None, stay.plan, action=2, problem="the tool is missing")
    found = judged(fitness(printer=LARGE), stay, unread, scoop)
    assert [evaluation.status for evaluation in found] == ["rejected", "rejected", "ok"]
    assert "walls, tool: thinnest 0.6" in found[0].reason
    assert found[1].reason == "the tool is missing"


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (
            {"of": "buildable"},
            "fitness.of: buildable can't judge for itself; name another fitness",
        ),
        ({"of": "layots"}, "no fitness 'layots' .did you mean 'layouts'"),
        ({"of": {}}, "fitness: {} names no fitness"),
        ({"printer": {"plate_mm": [200.0, 200.0]}}, "plate_mm must be three lengths"),
        ({"safety": 0.0}, "fitness.safety must be"),
        ({"margin_m": -1.0}, "fitness.margin_m must be between 0 and 0.2 m, got -1"),
    ],
)
def test_a_wrong_setting_is_reported(settings, said):
    with pytest.raises(UserError, match=said):
        fitness(**settings)


@pytest.mark.thorough
def test_the_prompt_names_the_constraints():
    words = [
        "task=MoveBall",
        "material=pla",
        "fitness=buildable",
        "fitness.of={name: robust, seeds: [0, 1]}",
    ]
    text = "".join(
        as_markdown(message)
        for message in compose(load("prompt", words, PromptConfig)).messages
    )
    for said in (
        "2 times in each of the engines",
        "no wall thinner than 0.8 mm. Its pieces fit into 250 x 210 x 220 mm",
        "at most 3 kg, and 12 N m about the mount",
        "pla bears 26 MPa",
        "the arm keeps 5 mm from itself and from all that is fixed",
    ):
        assert said in text
    paper = fitness(material=vars(Material())).instructions()
    assert paper.startswith("What counts is the reward of one rollout.")
    assert "Strength" not in paper


@pytest.mark.parametrize(("wall_mm", "found"), [(1.0, False), (1.5, True)])
def test_a_fixtures_walls_are_as_thick_as_a_printer_makes_them(scoop, wall_mm, found):
    """A wall of 1.2 mm stands as a fixture beside a tool that can be printed."""
    wall = Component("wall", "tool_mount", Pose(), Box((0.05, 0.0012, 0.03)))
    fixture = Fixture(Tool((wall,)), Pose.xyz_rpy((0.5, 0.3, 0.015)))
    tool = replace(scoop.tool, fixture=fixture)
    candidate = replace(scoop, tool=tool)

    where = next(iter(fitness(printer={**LARGE, "min_wall_mm": wall_mm}).conditions()))
    said = where.examiner.refuse(MOVE_BALL, candidate) or ""
    named = "walls, wall of the fixture: thinnest 1.20 mm, at least 1.5 mm"
    assert (named in said) == found
