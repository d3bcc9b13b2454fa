"""What a tool's sheet says: figures, what fails and what to change, on one page."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from core.design import Tool
from core.plugins import installed
from core.values.printers import Printer
from plugins.results.workshop.loads import Instant, Load
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.sheet import figures
from plugins.results.workshop.strength import Strength, strength
from plugins.results.workshop.tool import PrintedTool, make_tool
from plugins.results.workshop.verdicts import strong
from tests.support.exports import exported
from tests.support.panda import PANDA
from tests.support.workshop_tools import NEWTONS, SOLID, bar, print_bodies

PRINTER = Printer()
TASK = installed().create("task", "BringCube")


def said(thick, material=SOLID, printer=PRINTER, length=0.2):
    tool = material.made(Tool((bar("post", "tool_mount", 0.0, length, thick),)))
    load = Load(
        "wall", "post", np.array([0.0, 0.0, -length]), np.array([NEWTONS, 0.0, 0.0])
    )
    strengths = strength(tool, PANDA, material, {"engine": [Instant(0.0, [load])]})
    return figures(printed(tool, material, printer), strengths, TASK)


def printed(tool, material, printer):
    return PrintedTool(
        tool, tuple(print_bodies(tool, printer, material)), (), (), tool, material
    )


def failing(of):
    return {
        verdict["name"]: verdict
        for verdict in of["verdicts"]
        if verdict["passed"] is False
    }


def test_the_sheet_says_how_thick_a_thin_tool_must_be():
    thin = said(0.008)
    assert not thin["ready"]
    verdict = failing(thin)["strength"]
    assert verdict["part"] == "post"
    assert thin["least_safety"] == pytest.approx(
        26e6 * 0.008**3 / 6 / NEWTONS / 0.2, rel=0.05
    )
    assert f"safety factor {thin['least_safety']:.2f}" in verdict["found"]
    assert re.match(r"wall loads it with 10.0 N at (19[5-9]|200) mm", verdict["mend"])
    (times,) = re.findall(r"make post about ([\d.]+) times as thick", verdict["mend"])
    mended = said(0.008 * float(times))
    assert failing(mended) == {}
    assert mended["ready"]


@pytest.mark.parametrize(
    ("name", "bend_mm", "said"),
    [
        ("BringCube", 9.0, []),
        ("BringCube", 15.0, [(None, "20 mm")]),
        ("BringCube", 21.0, [(False, "20 mm")]),
        ("AroundCorner", 7.6, [(False, "7.5 mm")]),  # of which the tolerance is 15 mm
    ],
)
def test_what_bends_by_more_than_half_of_the_task_s_tolerance_fails(
    name, bend_mm, said
):
    row = Strength(
        "post", "tool_mount", "wall", 1.0, "engine", 0.0, 0.2, 1e6, 9.0, bend_mm / 1000
    )
    checks = [
        check
        for check in strong(SOLID, [row], installed().create("task", name))
        if check.name == "rigid"
    ]
    assert [
        (check.passed, re.search(r"most (.*) are", check.found)[1]) for check in checks
    ] == said
    assert all(check.mend.startswith("thicken or shorten it") for check in checks)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sheet")
    return folder, exported(folder, "material=pla", "printer.min_wall_mm=6")


@pytest.mark.thorough
def test_the_sheet_shows_the_tool_and_has_what_fails(written):
    folder, made = written
    text = (folder / "sheet.html").read_text()
    (shown,) = json.loads(re.search(r'id="tools-data">(.*?)</script>', text)[1])
    assert len(shown["solids"]) == 1 + len(made.candidate.tool.components)
    assert re.search(
        '<li class="fails">✗ walls, tool: thinnest .*; thicken the thinnest component</li>',
        text,
    )
    (verdict,) = failing(json.loads((folder / "sheet.json").read_text())).values()
    assert (verdict["name"], verdict["part"]) == ("walls", "tool")
    assert verdict["mend"] == "thicken the thinnest component"


def test_the_sheet_has_the_forces_of_the_rollout_and_what_one_needs_at_the_bench(
    written,
):
    folder, made = written
    found = json.loads((folder / "sheet.json").read_text())
    assert found["task"] == "OneBook"
    assert re.fullmatch(r"20\d\d-\d\d-\d\d", found["date"])
    assert found["flange"] == (
        "a ring of 4 bores M6 on a circle of 50 mm, the first at 0° from the mount's x; disc 63 mm; recess 31.5 mm; "
        "pin 6 mm at -135°"
    )
    assert "1 pin 6 m6 x 12" in found["hardware"]
    assert [piece["file"] for piece in found["pieces"]] == ["tool.stl"]
    hook, beam = found["parts"]
    assert (hook["name"], beam["name"]) == ("hook", "beam")
    forces = made.replays["mujoco"].recording.forces
    assert (hook["load"], hook["engine"]) == ("book_3", "mujoco")
    normal = forces["tool", "book_3"].max()
    assert 0.5 * normal < hook["newtons"] <= np.hypot(1, 0.5) * normal  # with friction
    assert hook["safety"] == pytest.approx(26e6 / hook["stress_pa"])
    assert found["least_safety"] == hook["safety"] < beam["safety"]
    assert found["mass_kg"] == pytest.approx(made.payload["mass_kg"], abs=1e-5)


def test_metal_is_milled_in_one_part_and_nothing_of_plastic_is_said():
    steel = replace(SOLID, name="steel", density_kg_m3=7850)
    made = make_tool(
        Tool((bar("post", "tool_mount", 0.0, 0.6, 0.02),)), PANDA, steel, PRINTER, Fit()
    )
    assert len(made.parts) == 1
    text = json.dumps(figures(made, [], TASK))
    assert not re.search(
        "plate, tool|layers|print(ed|s) |insert|glue|infill|fits the plate", text
    )
