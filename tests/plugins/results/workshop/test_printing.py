"""Solids to print: known shapes, and what must be said against them."""

import pytest
import trimesh

from core.design import Component
from core.geometry import Box, Pose
from core.values.printers import Printer
from plugins.results.workshop.lying import lay
from plugins.results.workshop.printing import grams, thinnest
from tests.support.workshop_tools import print_bodies, tool

WIDE = Printer(plate_mm=(500.0, 500.0, 500.0))


def box(name, parent, at, size, rpy=(0, 0, 0)):
    return Component(name, parent, Pose.xyz_rpy(at, rpy), Box(size))


def failed(piece):
    return [check.name for check in piece.checks if not check.passed]


def found(piece, name):
    return next(check.found for check in piece.checks if check.name == name)


def test_boxes_that_touch_by_their_faces_become_one_body():
    one = box("one", "tool_mount", (0, 0, 0), (0.03, 0.03, 0.03))
    other = box("other", "one", (0.03, 0, 0), (0.03, 0.03, 0.03))
    (piece,) = print_bodies(tool(one, other), WIDE)
    assert failed(piece) == []
    assert sorted(piece.mesh.extents) == pytest.approx([30, 30, 60], abs=0.05)
    assert grams([piece]) == pytest.approx(54 * 1.24, rel=0.01)


@pytest.mark.parametrize(("gap_mm", "weld"), [(0.01, 0.01), (0.15, 0.1), (0.9, 0.5)])
def test_gaps_that_a_design_may_have_are_closed_by_as_little_as_does_it(gap_mm, weld):
    one = box("one", "tool_mount", (0, 0, 0), (0.03, 0.03, 0.03))
    other = box("other", "one", (0.03 + gap_mm / 1000, 0, 0), (0.03, 0.03, 0.03))
    (piece,) = print_bodies(tool(one, other), WIDE)
    assert failed(piece) == []
    assert (piece.mesh.body_count, piece.weld_mm) == (1, weld)
    assert ("gaps closed" in found(piece, "one piece")) == (weld > 0.01)


def test_components_with_sides_in_one_plane_make_a_closed_file():
    socket = box("socket", "tool_mount", (0, 0, -0.006), (0.05, 0.05, 0.012))
    thick = 0.017478942044
    turn = 2.782373713772
    at = (-0.021409147902, 0.008039378961, -0.002739471022)
    boom = box("boom", "socket", at, (0.063216595154, thick, thick), (0, 0, turn))
    drop = box(
        "drop",
        "boom",
        (0.022868826555, 0, -0.027996864818),
        (thick, thick, 0.055993729637),
        (0, 0, -turn),
    )
    wall = box(
        "wall",
        "drop",
        (-0.003260528978, 0, -0.042996864818),
        (0.008, 0.113959183673, 0.03),
    )
    tine = box(
        "tine",
        "wall",
        (0.012795030527, 0.048979591837, -0.0114),
        (0.033590061055, 0.016, 0.0072),
    )
    (piece,) = print_bodies(tool(socket, boom, drop, wall, tine), WIDE)
    assert failed(piece) == []
    assert piece.weld_mm == 0.01


def test_parts_that_touch_by_an_edge_only_or_not_at_all_are_said():
    one = box("one", "tool_mount", (0, 0, 0), (0.03, 0.03, 0.03))
    (piece,) = print_bodies(
        tool(one, box("far_one", "one", (0.05, 0, 0), (0.03, 0.03, 0.03))), WIDE
    )
    assert failed(piece) == ["one piece"]
    assert "far_one" in found(piece, "one piece")
    edge = box("edge", "one", (0.03, 0.03, 0), (0.03, 0.03, 0.03))
    (piece,) = print_bodies(tool(one, edge), WIDE)
    assert failed(piece) == ["one piece"]
    bridge = box("bridge", "one", (0.015, 0.015, 0.02), (0.06, 0.06, 0.02))
    (piece,) = print_bodies(tool(one, edge, bridge), WIDE)  # held by a third
    assert failed(piece) == []


def test_the_thickness_of_known_solids():
    assert thinnest(trimesh.creation.box((10, 20, 3))) == pytest.approx(3)
    pipe = trimesh.creation.annulus(r_min=8, r_max=10, height=30, sections=96)
    assert thinnest(pipe) == pytest.approx(2, abs=0.05)
    ball = trimesh.creation.icosphere(subdivisions=3, radius=10)
    assert thinnest(ball) == pytest.approx(20, abs=0.3)
    pocket = trimesh.creation.box((20, 20, 10)).apply_translation((0, 0, 0.6))
    body = trimesh.boolean.difference(
        [trimesh.creation.box((40, 40, 10)), pocket], engine="manifold"
    )
    assert thinnest(body) == pytest.approx(0.6)


def test_a_long_piece_is_laid_across_the_plate():
    rod = trimesh.creation.box((310, 10, 10))
    lying = lay(rod, (250, 210, 220))
    assert lying.fits
    assert lying.size[0] <= 250
    assert lying.size[1] <= 210
    assert lying.mesh.bounds[0, 2] == pytest.approx(0)
    # Its diagonal is 326.5 mm.
    assert not lay(trimesh.creation.box((340, 10, 10)), (250, 210, 220)).fits


def test_attachments_of_a_gripper_are_two_pieces():
    pads = [
        box(f"pad_{mount}", mount, (0, side * 0.0075, 0.07), (0.02, 0.015, 0.04))
        for mount, side in (("left_finger", 1), ("right_finger", -1))
    ]
    made = print_bodies(tool(*pads, gripper=True), Printer())
    assert [piece.name for piece in made] == ["left", "right"]
    assert [failed(piece) for piece in made] == [[], []]
