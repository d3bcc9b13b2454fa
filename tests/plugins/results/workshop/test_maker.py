"""What is said of the best tool at the end of a run: whether it can be made, and bears what it has to."""

from dataclasses import replace

import pytest

from core.config.compose import load, node
from core.design import Component, Tool
from core.geometry import Box, Pose
from core.values.materials import PAPER, Material
from core.values.printers import MK4
from plugins.results.workshop.maker import judge_tool
from tests.panda import PANDA

PLA = node(load("evaluate", []).material, Material)


def judge(thick, material=PLA, printer=MK4):
    """What is said of a plate of 30 mm by 200 mm that is so thick."""
    shape = Box((0.03, thick, 0.2))
    tray = Component("tray", "tool_mount", Pose.xyz_rpy((0, 0, -0.1)), shape, 0.05)
    return judge_tool(material.made(Tool((tray,))), PANDA, material, printer)


@pytest.mark.parametrize("material", [PLA, PAPER])
def test_a_stiff_tool_can_be_printed_and_pieces_hours_and_grams_are_said(material):
    making = judge(0.03, material)
    assert making.possible
    assert making.words.startswith("printable: yes, in 1 piece, about ")
    assert making.words.endswith(" g of pla")


@pytest.mark.parametrize(
    ("thick", "said"),
    [
        (0.003, "component 'tray' is not rigid: of pla, 1 N would bend it by "),
        (0.0005, ": thinnest 0.50 mm, at least 0.8 mm"),
    ],
)
def test_what_can_not_be_made_has_one_verdict_with_the_reason(thick, said):
    making = judge(thick)
    assert making.possible is False
    assert said in making.problem
    assert making.words == f"printable: no ({making.problem})"


def test_the_printer_of_the_run_counts():
    assert (
        judge(0.03, printer=replace(MK4, plate_mm=(40.0, 40.0, 40.0))).possible is False
    )


def test_metal_is_milled():
    steel = node(load("evaluate", ["material=steel"]).material, Material)
    assert judge(0.01, steel).words.startswith("to be milled: yes, in 1 piece, ")
