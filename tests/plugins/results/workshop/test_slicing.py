"""What a slicer is asked, and what becomes of one that hangs, fails, or is another program."""

import os
from pathlib import Path

import pytest
import trimesh

from core.config.compose import tool_part
from core.errors import UsageError, UserError
from core.interfaces import Material
from core.values.printers import Printer
from docs import gallery
from plugins.results.workshop.plates import arrange
from plugins.results.workshop.printing import print_part
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.slicing import (
    ask_slicer,
    find_slicer,
    slice_plates,
    write_profile,
)
from plugins.results.workshop.solid import ToolLink, manifold
from plugins.results.workshop.tool import make_tool

PLA = Material("pla", 1240.0, infill=0.2, wall_mm=1.2)
GCODE = """;TYPE:Perimeter
G1 X1 Y1 E2.0
;TYPE:Support material
G1 X2 Y1 E1.0
; filament used [g] = 30.0
; estimated printing time (normal mode) = 1d 2h 30m 36s
"""


@pytest.fixture(scope="module")
def part():
    link = ToolLink("tool_mount", "tool_mount", (), ())
    cube = manifold(trimesh.creation.box((20, 20, 20)))
    return print_part("tool", link, cube, 0.0, Printer(), PLA)


def program(folder: Path, text: str) -> Path:
    file = folder / "slicer"
    file.write_text(f"#!/bin/sh\n{text}\n")
    file.chmod(0o755)
    return file


def test_hours_grams_and_supports_are_read(part, tmp_path):
    (tmp_path / "plate.gcode").write_text(GCODE)
    say = "echo 'print warning: Loose extrusions'; "
    slicer = program(
        tmp_path,
        f'{say}while [ "$1" != -o ]; do shift; done; cp {tmp_path}/plate.gcode "$2"',
    )
    data, checks = ask_slicer(slicer, [part], Printer(), PLA)
    assert data["hours"] == pytest.approx(26.51)
    assert (data["grams"], data["support_g"]) == (30.0, 10.0)
    assert [check.passed for check in checks] == [True, None]
    assert "Loose extrusions" in checks[1].found


def test_a_profile_that_is_not_there_is_named(part, tmp_path):
    printer = Printer(profile=str(tmp_path / "mine.ini"))
    with pytest.raises(UserError, match=r"printer.profile=.*mine.ini: no such file"):
        slice_plates(program(tmp_path, "exit 0"), [], printer, PLA)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("sleep 60", "has not sliced a plate in 0.3 s"),
        ("echo no config; exit 3", "failed with status 3: no config"),
        ("exit 0", "wrote no toolpaths"),
        (
            'while [ "$1" != -o ]; do shift; done; echo G1 > "$2"',
            "name no time or no filament",
        ),
    ],
)
def test_a_slicer_that_hangs_fails_or_is_another_program_is_said(
    part, tmp_path, text, said
):
    slicer = program(tmp_path, text)
    limit_s = 0.3 if "sleep" in text else 60.0
    plates = arrange([part], Printer())
    with pytest.raises(UserError, match=said):
        slice_plates(slicer, plates, Printer(), PLA, limit_s)


def test_without_a_slicer_a_dash_says_how_to_get_one(part):
    data, (check,) = ask_slicer(None, [part], Printer(), PLA)
    assert data == {}
    assert check.passed is None
    assert "apt-get install prusa-slicer" in check.found
    with pytest.raises(UserError, match="no such program"):
        find_slicer("no_such_slicer_here")


def test_the_profile_has_the_printer_s_plate_and_speeds():
    slow = Printer((220.0, 210.0, 250.0), 0.8, "slow", "", 60.0, 500.0, 8.0)
    lines = write_profile(slow, PLA).splitlines()
    for line in (
        "bed_shape = 0x0,220x0,220x210,0x210",
        "max_print_height = 250",
        "infill_speed = 60",
        "perimeter_speed = 40",
        "external_perimeter_speed = 27",
        "default_acceleration = 500",
        "machine_max_acceleration_extruding = 500,500",
        "filament_max_volumetric_speed = 8",
    ):
        assert line in lines
    with pytest.raises(UsageError, match="speed_mm_s"):
        Printer(speed_mm_s=0.0)


@pytest.mark.slicer
def test_a_slow_printer_takes_longer(part):
    slicer = find_slicer(os.environ.get("SLICER", "prusa-slicer"))
    hours = []
    for speed, acceleration in ((60.0, 500.0), (180.0, 3000.0)):
        printer = Printer(speed_mm_s=speed, acceleration_mm_s2=acceleration)
        hours.append(ask_slicer(slicer, [part], printer, PLA)[0]["hours"])
    assert hours[0] > 1.3 * hours[1]


@pytest.mark.slicer
def test_the_real_slicer_says_what_a_cube_takes(part):
    slicer = find_slicer(os.environ.get("SLICER", "prusa-slicer"))
    data, checks = ask_slicer(slicer, [part], Printer(), PLA)
    assert checks[0].passed
    assert 0.1 < data["hours"] < 2
    assert 2 < data["grams"] < 10


@pytest.mark.slicer
@pytest.mark.parametrize("task", ["BringCube", "HighObject", "OneBook", "SnatchCookie"])
@pytest.mark.parametrize("designer", ["model", "embedded"])
def test_tools_of_the_gallery_are_sliced(task, designer):
    """What it weighs besides supports is what is said, within a quarter."""
    entry = gallery.Entry(task, designer)
    config = entry.config(material="pla")
    material = tool_part(config).create().material
    tool = entry.read("pla").tool
    robot = entry.condition("mujoco").task.shared().robot
    made = make_tool(tool, robot, material, Printer(), Fit())
    slicer = find_slicer(os.environ.get("SLICER", "prusa-slicer"))
    data, checks = ask_slicer(slicer, made.parts, Printer(), material)
    if all(part.lying.fits for part in made.parts):
        assert checks[0].passed
        grams = data["grams"] - data["support_g"]
        assert grams == pytest.approx(made.mass_g, rel=0.25)
