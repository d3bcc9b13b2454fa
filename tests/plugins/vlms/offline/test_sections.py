"""How thick parts are: stiff enough for their load by the beams of the rules, and no thicker."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import RIGID_MOUNT, Component, Tool
from core.designs.rules import check_tool
from core.designs.stiffness import Beams, second_moment
from core.geometry import Box, Pose
from core.interfaces import PAPER, Material
from core.plugins import installed
from plugins.vlms.offline.search import Search
from plugins.vlms.offline.sections import (
    BLOW,
    SAFETY,
    SAG_M,
    find_thickness,
    measure_leverage,
)
from tests.plugins.vlms.offline.trying import make_brief
from tests.support.panda import on_panda

PLA = Material("pla", 1240, 0.2, 1.2, 0.5, 2.5e9, 26e6)
LENGTH = 0.4
START = np.zeros(3)
END = np.array([LENGTH, 0, 0])


def bears(load, thick, wide, material, place):
    """Report whether a bar bears a blow at a place ahead of it, by the beams of the rules."""
    bar = Component("bar", RIGID_MOUNT, Pose(), Box((LENGTH, wide, thick)))
    beams = Beams(Tool((bar,)), {"bar": START}, material)
    beam = beams.beam("bar", END)
    blow = BLOW * load
    bend = blow * beam.softness / LENGTH * measure_leverage([(START, END)], place)
    stress = blow * beam.weakness * np.linalg.norm(place)
    strong = material.strength_pa is None or SAFETY * stress <= material.strength_pa
    return bend <= SAG_M and strong


@pytest.mark.parametrize("material", [PLA, PAPER])
@pytest.mark.parametrize("wide", [None, 0.05])
@pytest.mark.parametrize("beyond", [0.0, 0.3])
@pytest.mark.parametrize("load", [2.0, 10.0])
def test_a_bar_is_as_thick_as_its_load_asks_and_no_thicker(
    material, wide, beyond, load
):
    place = END + np.array([beyond, 0, 0])
    leverage = measure_leverage([(START, END)], place)
    lever = np.linalg.norm(place)
    thick = find_thickness(
        load, lever, leverage, material, least=0.001, most=0.08, wide=wide
    )
    thinner = thick - 0.001
    assert bears(load, thick, wide or thick, material, place)
    assert not bears(load, thinner, wide or thinner, material, place)


def test_a_short_bar_is_as_thick_as_its_strength_asks():
    """It hardly bends, whatever it bears."""
    thick = find_thickness(50, 0.05, 0.05**3 / 3, PLA, least=0.001, most=0.05)
    stiff = find_thickness(
        50, 0.05, 0.05**3 / 3, replace(PLA, strength_pa=None), least=0.001, most=0.05
    )
    stress = BLOW * 50 * 0.05 * thick / 2 / second_moment(thick, thick, PLA)
    assert stiff < thick
    assert SAFETY * stress == pytest.approx(PLA.strength_pa, rel=0.15)


def test_a_bar_keeps_its_limits():
    assert find_thickness(1, 0.1, 0.001, PAPER, least=0.01, most=0.04) == 0.01
    assert find_thickness(1000, 1, 1, PLA, least=0.01, most=0.04) == 0.04


def test_the_leverage_of_bars_is_that_of_the_rules():
    """Two bars at a right angle, with the force at the end of the second."""
    corner = np.array([LENGTH, 0, 0])
    low = np.array([LENGTH, 0, -0.2])
    bars = [(START, corner), (corner, low)]
    along = LENGTH * 0.2**2 + LENGTH**3 / 3
    assert measure_leverage(bars, low) == pytest.approx(along + 0.2**3 / 3)


@pytest.mark.parametrize("name", ["BringCube", "DislodgeCube", "OneBook"])
def test_tools_can_be_made_of_what_is_printed(name):
    brief = make_brief(on_panda(installed().create("task", name)))
    brief.representation.material = PLA
    search = Search(brief)
    for _ in range(5):
        tool = PLA.made(search.invent().tool)
        check_tool(tool, brief.task.robot, PLA)
