"""What is said of the best tool at the end of a run: whether it can be made, and bears what it has to."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from omegaconf import OmegaConf

from core.config.compose import load, node, task_part, tool_part
from core.design import Component, Tool
from core.geometry import Box, Pose
from core.interfaces import Condition, RolloutSettings
from core.plugins import PluginPart
from core.simulation.play import play
from core.values.materials import PAPER, Material
from core.values.printers import MK4
from plugins.results.chosen import chosen_evaluations
from plugins.results.workshop.export_command import configured, export
from plugins.results.workshop.maker import judge_design, judge_tool
from tests.support.panda import PANDA

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


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("task", "side_mm", "possible"),
    [
        ("OneBook", 500, True),
        ("MoveBall", 500, True),
        ("OneBook", 60, False),
    ],
)
def test_the_verdict_of_a_run_is_that_of_its_export(task, side_mm, possible, tmp_path):
    words = [f"task={task}", "tool=boxes", f"printer.plate_mm={[side_mm] * 3}"]
    designs = f"designs=tests/tasks/anchored/{task}.json"
    cfg = configured([designs, *words, f"output={tmp_path / 'out'}"])
    part = task_part(cfg)
    representation = tool_part(cfg).create()
    (best, *_) = chosen_evaluations(cfg, representation, part.shared())
    settings = node(cfg.rollout, RolloutSettings)
    condition = Condition(part, PluginPart("sim", "mujoco"), 0, settings)
    (trial,) = play(condition, [best.candidate])
    tried = replace(best, trials=(trial,))
    run = SimpleNamespace(
        config=OmegaConf.to_container(
            load("config", [*words, "sim=mujoco"]), resolve=True
        ),
        representation=representation,
        task=part.shared(),
    )
    making = judge_design(run, condition, tried)
    (exported,) = export(cfg)
    failing = [str(check) for check in exported.verdicts if check.passed is False]
    assert making.possible == (not failing) == possible
    assert possible or making.problem in failing
