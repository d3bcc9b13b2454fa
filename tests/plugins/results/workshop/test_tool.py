"""A tool's files, read back by others; what is said against it; and what it earns as it is built."""

from dataclasses import replace

import pytest
import trimesh

from core.design import Component, Tool
from core.geometry import Box, Capsule, Cylinder, Pose, Sphere
from core.interfaces import Material
from core.values.grips import GRIPS
from core.values.printers import Printer
from plugins.results.workshop import body
from plugins.results.workshop.body import bodies
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import (
    box,
    joined_solids,
    manifold,
    to_mesh,
    union,
)
from plugins.results.workshop.tool import make_tool, write_tool
from tests.support.panda import PANDA
from tests.support.shapes import prism
from tests.support.tongs import tongs

PLA = Material("pla", 1240.0, infill=0.2, wall_mm=1.2)


def at(x, y, z):
    return Pose.xyz_rpy((x, y, z))


LONG = Tool(
    (
        Component("post", "tool_mount", at(0, 0, -0.05), Cylinder(0.014, 0.1)),
        Component("beam", "post", at(0.2, 0, -0.05), Box((0.44, 0.03, 0.02))),
        Component("tip", "beam", at(0.2, 0, -0.05), Capsule(0.01, 0.08)),
        Component("ball", "beam", at(-0.2, 0, -0.02), Sphere(0.02)),
        Component("head", "beam", at(0.1, 0, -0.02), prism(5, 0.02, 0.03)),
    )
)


def faults(made):
    return [str(check) for check in made.verdicts if not check.passed]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tool")
    printer = Printer([500.0] * 3)
    made = make_tool(PLA.made(LONG), PANDA, PLA, printer, Fit())
    write_tool(made, folder, printer)
    return folder, made


def test_the_files_put_together_are_the_tool(written):
    folder, made = written
    pieces = []
    for part in made.parts:
        mesh = trimesh.load(folder / part.file)
        assert mesh.is_volume
        assert part.mesh.volume == pytest.approx(mesh.volume, rel=1e-3)
        pieces.append(manifold(mesh.apply_transform(part.to_mount)))

    assert len(pieces) == 2  # whole it would stand on an edge
    whole = joined_solids(pieces)
    simulated = union(
        [(c.shape, made.mounted.placed()[c.name][1]) for c in made.mounted.components]
    )
    beyond = (whole - simulated).trim_by_plane((0, 0, -1), -0.1)
    # The weld of 0.01 mm; above is the boss.
    assert beyond.volume() < 0.02 * simulated.surface_area()
    assert (simulated - whole).volume() < 0.01 * simulated.volume()  # bores
    assert sum(piece.volume() for piece in pieces) == pytest.approx(whole.volume())
    assert faults(made) == []


def test_figures_and_the_list(written):
    folder, made = written
    # It is filled to a fifth.
    assert made.parts[0].mass_g < 1.24 * made.parts[0].mesh.volume / 1000
    assert 1000 * made.printed.mass == pytest.approx(made.mass_g)
    assert 1000 * made.printed.mass == pytest.approx(1000 * made.mounted.mass, rel=0.2)
    names = {file.name for file in folder.iterdir()}
    assert names == {"tool.3mf", *(part.file for part in made.parts)}
    assert "4 x M6 x 12" in made.hardware


def test_what_joints_move_is_made_and_what_is_missing_is_said():
    made = make_tool(tongs(), PANDA, Material(), Printer(), Fit())
    assert [part.name for part in made.parts] == ["tool", "left", "right"]
    assert "joint, left: the hinge is to be made by the workshop" in faults(made)
    assert all(part.mesh.is_volume for part in made.parts)


def test_a_solid_whose_bodies_touch_along_an_edge_is_closed():
    mesh = to_mesh(
        union(
            [
                box((0, 0, 0), (0.01, 0.01, 0.01)),
                box((0.01, 0.01, 0), (0.02, 0.02, 0.01)),
            ]
        )
    )
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(2000)


def test_a_weld_is_another_where_a_body_is_closed_but_not_as_it_lies(monkeypatch):
    answers = iter([True, False, True, True])
    monkeypatch.setattr(body, "closed", lambda mesh: next(answers))
    bodies(Tool(LONG.components[:1]))
    assert list(answers) == []


@pytest.mark.parametrize(("kind", "bought"), [("suction", "cup"), ("magnet", "N42")])
def test_what_grips_is_bought(kind, bought):
    grip = GRIPS[kind]("bottom", 300)
    post = Component("post", "tool_mount", at(0, 0, -0.05), Box((0.03, 0.03, 0.1)))
    made = make_tool(
        PLA.made(Tool((replace(post, grips=grip),))), PANDA, PLA, Printer(), Fit()
    )
    (part,) = [name for name in made.hardware if "for post" in name]
    assert bought in part
    assert any("pump" in fault for fault in faults(made)) == grip.switched
