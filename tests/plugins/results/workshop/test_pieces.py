"""What is longer than the plate comes in pieces: how they lie, what joins them, and what can't be cut."""

import numpy as np
import pytest
import trimesh

from core.design import Component, Tool
from core.errors import UserError
from core.geometry import Box, Cylinder
from core.values.printers import Printer
from plugins.results.workshop.assembly import draw_apart, picture
from plugins.results.workshop.export_command import configured, export
from plugins.results.workshop.loads import Instant, Load
from plugins.results.workshop.lying import lay
from plugins.results.workshop.numbering import engrave
from plugins.results.workshop.plates import arrange, to_3mf
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import joined_solids, manifold, to_mesh, union
from plugins.results.workshop.strength import strength
from plugins.results.workshop.tool import make_tool
from tests.support.panda import PANDA
from tests.support.workshop_tools import HOOK, MINI, PLA, at

STRIP = Tool(
    (Component("strip", "tool_mount", at(0, 0, -0.2), Box((0.02, 0.004, 0.4))),)
)


def make(tool, printer=MINI):
    return make_tool(PLA.made(tool), PANDA, PLA, printer, Fit())


def failing(made):
    return [str(check) for check in made.verdicts if check.passed is False]


@pytest.fixture(scope="module")
def hook():
    return make(HOOK)


def solid(*boxes):
    """The union of boxes, by their sizes and middles."""
    parts = [
        trimesh.creation.box(size).apply_translation(middle) for size, middle in boxes
    ]
    return trimesh.boolean.union(parts, engine="manifold")


def test_a_part_lies_on_a_side_and_not_on_a_point():
    hooked = solid(((240, 10, 10), (0, 0, 0)), ((10, 10, 60), (115, 0, 25)))
    lying = lay(hooked, (250.0, 210.0, 220.0))
    assert lying.fits
    assert lying.contact_mm2 == pytest.approx(240 * 10 + 50 * 10)
    assert lying.size[2] == pytest.approx(10)
    assert lying.overhang_mm2 == pytest.approx(0)

    # Along the space's diagonal it would fit a cube of 165 mm, on a point.
    lying = lay(hooked, (165.0, 165.0, 165.0))
    assert not lying.fits
    assert lying.contact_mm2 > 600


def test_what_leans_out_is_measured():
    foot = ((80, 60, 5), (0, 0, -17.5))
    table = solid(foot, ((20, 20, 40), (0, 0, 0)), ((60, 20, 10), (0, 0, 20)))
    lying = lay(table, (250.0, 210.0, 220.0))
    assert lying.contact_mm2 == pytest.approx(80 * 60)
    assert lying.overhang_mm2 == pytest.approx(40 * 20)


def test_a_long_hook_comes_in_the_fewest_pieces_that_fit(hook):
    assert failing(hook) == []
    assert [part.name for part in hook.parts] == ["tool_1", "tool_2", "tool_3"]
    assert all(part.lying.fits and part.lying.firm for part in hook.parts)
    assert {joint.component for joint in hook.joints} == {"arm"}
    assert "4 x M3 x 8 countersunk screw" in hook.hardware
    joined = {number for joint in hook.joints for number in joint.pieces}
    assert joined == {1, 2, 3}

    (whole,) = make(HOOK, Printer((450.0, 450.0, 450.0))).parts
    assert whole.lying.fits
    assert whole.name == "tool"


def test_pieces_put_together_are_what_was_simulated(hook):
    whole = joined_solids([part.solid for part in hook.parts])
    placed = hook.mounted.placed()
    simulated = [(c.shape, placed[c.name][1]) for c in HOOK.components]
    wide = [
        (shape.resized(shape.bounds[1] + 0.0004), pose) for shape, pose in simulated
    ]
    outside = (whole - union(wide)).trim_by_plane((0, 0, -1), 7.0)
    assert outside.volume() < 1

    # Only gaps of joints, bores, screws, numbers and the arm's flange are missing.
    lack = union(simulated) - whole
    assert lack.volume() < 0.05 * whole.volume()
    for part, other in ((0, 1), (0, 2), (1, 2)):
        shared = hook.parts[part].solid ^ hook.parts[other].solid
        assert shared.volume() < 1e-3


def test_screws_weigh_and_a_joint_is_simulated(hook):
    names = [component.name for component in hook.mounted.components]
    assert names[-2:] == ["joint_1", "joint_2"]
    plastic = sum(part.mass_g for part in hook.parts)
    assert hook.mass_g == pytest.approx(plastic + 2 * 2)
    assert 1000 * hook.printed.mass == pytest.approx(hook.mass_g)


def test_a_joint_is_as_strong_as_its_tongue(hook):
    joint = max(hook.joints, key=lambda joint: joint.place[0])
    lever = 0.3 - float(joint.place[0])
    load = Load("stone", "arm", np.array([0.3, 0.0, -0.035]), np.array([0, 0, -10.0]))
    rows = strength(
        PLA.made(HOOK), PANDA, PLA, {"": [Instant(0.0, [load])]}, hook.joints
    )
    (row,) = [row for row in rows if row.component == joint.name]
    about = {
        round(value, 12)
        for value in (10 * lever / (1e-9 * m) for m in joint.moduli_mm3)
    }
    assert round(row.stress_pa, 12) in about or row.stress_pa == pytest.approx(
        10 * lever / (1e-9 * joint.moduli_mm3[0])
    )
    beam = next(row for row in rows if row.component == "arm")
    assert row.stress_pa > beam.stress_pa * lever / beam.lever_m

    before = Load("stone", "arm", np.array([0.05, 0.0, -0.035]), np.array([0, 0, -9.0]))
    rows = strength(
        PLA.made(HOOK), PANDA, PLA, {"": [Instant(0.0, [before])]}, hook.joints
    )
    assert joint.name not in {row.component for row in rows}


@pytest.mark.thorough
def test_a_thin_shaft_is_thicker_around_its_joint_and_flat_on_one_side():
    made = make(STRIP)
    assert {line.partition(":")[0] for line in failing(made)} <= {"weight"}
    assert all(joint.thicker_mm > 5 for joint in made.joints)
    component = next(c for c in made.mounted.components if c.name == "joint_1")
    assert min(component.shape.bounds[1]) > 0.011


@pytest.mark.thorough
def test_a_thin_rod_comes_in_closed_pieces():
    rod = Component("rod", "tool_mount", at(0, 0, -0.1), Cylinder(0.002, 0.2))
    made = make(Tool((rod,)))
    assert len(made.parts) == 2
    assert {line.partition(":")[0] for line in failing(made)} <= {"weight"}


def bars(length, width, floor=False):
    """A post that bears a square of bars: closed, or open on one side; with a floor it is a tray."""
    far = (length - width) / 2
    post = Component("post", "tool_mount", at(0, 0, -0.05), Box((0.03, 0.03, 0.1)))
    near = Component("near", "post", at(0, 0, -0.05), Box((width, length, width)))
    parts = [post, near]
    for name, x, y, size in (
        ("left", far, far, (length, width, width)),
        ("right", far, -far, (length, width, width)),
        ("far", 2 * far, 0, (width, length, width)),
    ):
        parts.append(Component(name, "near", at(x, y, 0), Box(size)))
    if floor:
        size = (length, length, 0.004)
        parts.append(Component("floor", "near", at(far, 0, -width / 2), Box(size)))

    return parts


@pytest.fixture(scope="module")
def loop():
    return make(Tool(tuple(bars(0.3, 0.02))))


def test_a_loop_is_opened_by_two_cuts_along_one_direction(loop):
    assert failing(loop) == []
    assert all(part.lying.fits for part in loop.parts)
    opening = [joint for joint in loop.joints if joint.beside]
    assert len(opening) == 2
    first, second = opening
    assert first.along @ second.along == pytest.approx(1)

    for joint in loop.joints:
        below, above = (loop.parts[number - 1].solid for number in joint.pieces)
        assert below is not above
        for share in (0.0, 0.5, 1.0):
            drawn_off = above.translate(tuple(share * joint.reach_mm * joint.along))
            assert (drawn_off ^ below).volume() < 1


@pytest.mark.thorough
def test_exact_solids_of_a_loop_are_its_pieces(loop, tmp_path):
    exact = pytest.importorskip("plugins.results.workshop.exact")
    assert exact.write_step(loop, tmp_path).passed


@pytest.mark.parametrize(
    ("tool", "plate", "said"),
    [
        (HOOK, 20.0, "shorten arm"),
        (Tool(tuple(bars(0.3, 0.02, floor=True))), 180.0, "it is closed like a tray"),
        (Tool(tuple(bars(0.3, 0.02)[:1])), 20.0, "mm of a component straight and free"),
        (
            Tool(
                (
                    Component(
                        "wall", "tool_mount", at(0, 0, -0.2), Box((0.3, 0.3, 0.004))
                    ),
                )
            ),
            60.0,
            "shorten wall",
        ),
    ],
)
def test_what_no_cut_makes_fit_stays_whole_and_says_what_to_shorten(tool, plate, said):
    made = make(tool, Printer((plate,) * 3))
    assert len(made.parts) == 1
    assert made.joints == ()
    (line,) = [line for line in failing(made) if line.startswith("fits the plate")]
    assert said in line


def test_a_tool_that_is_a_thin_wire_says_what_to_thicken():
    wire = Component("wire", "tool_mount", at(0, 0, -0.05), Cylinder(0.0003, 0.1))
    made = make(Tool((wire,)))
    (line,) = [line for line in failing(made) if line.startswith("walls")]
    assert "thinnest 0.6" in line
    assert "thicken" in line


def test_numbers_are_pressed_into_pieces(hook):
    for number, part in enumerate(hook.parts, 1):
        again = engrave(part.solid, number)
        pressed = (part.solid - again).volume()
        assert 0.4 * 5 < pressed < 0.4 * 40

    thin = manifold(trimesh.creation.box((50, 50, 1)))
    assert engrave(thin, 1).volume() == pytest.approx(thin.volume())


def test_plates_hold_all_pieces_apart_and_the_file_says_where(hook, tmp_path):
    plates = arrange(hook.parts, MINI)
    assert sum(len(plate.parts) for plate in plates) == 3
    for plate in plates:
        boxes = []
        for part, middle in plate.parts:
            half = np.array(part.lying.size[:2]) / 2
            assert (np.array(middle) - half >= -1e-6).all()
            assert (np.array(middle) + half <= 180 + 1e-6).all()
            boxes.append((np.array(middle) - half, np.array(middle) + half))
        for i, (low, high) in enumerate(boxes):
            for other_low, other_high in boxes[i + 1 :]:
                assert ((high < other_low) | (other_high < low)).any()

    file = tmp_path / "tool.3mf"
    file.write_bytes(to_3mf(plates, MINI))
    scene = trimesh.load(file)
    assert scene.units in ("mm", "millimeter", "millimeters")
    assert set(scene.geometry) == {"tool_1", "tool_2", "tool_3"}
    for name, mesh in scene.geometry.items():
        part = next(part for part in hook.parts if part.name == name)
        assert mesh.volume == pytest.approx(part.mesh.volume, rel=1e-3)


def test_the_picture_shows_pieces_apart(hook):
    apart = draw_apart(hook.parts, hook.joints, PANDA)
    boxes = [item.solid.bounds for item in apart]
    for i, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[i + 1 :]:
            assert ((high < other_low) | (other_high < low)).any()
    assert picture(apart).startswith(b"\x89PNG")


def test_exact_solids_are_the_pieces(hook, tmp_path):
    exact = pytest.importorskip("plugins.results.workshop.exact")
    from OCP.STEPControl import STEPControl_Reader

    check = exact.write_step(hook, tmp_path)
    assert check.passed
    names = {file.name for file in tmp_path.iterdir()}
    assert names == {"tool_1.step", "tool_2.step", "tool_3.step"}

    text = (tmp_path / "tool_1.step").read_text()
    assert "MANIFOLD_SOLID_BREP" in text
    for part in hook.parts:
        reader = STEPControl_Reader()
        reader.ReadFile(str(tmp_path / f"{part.name}.step"))
        reader.TransferRoots()
        solid = exact.Exact(reader.OneShape())
        assert solid.volume() == pytest.approx(part.solid.volume(), rel=0.01)
        middle = to_mesh(part.solid).center_mass
        assert solid.middle == pytest.approx(middle, abs=0.1)


def test_a_failed_export_leaves_no_empty_folder(tmp_path):
    folder = tmp_path / "export"
    cfg = configured(["designs=/no/such/file.json", "task=OneBook", f"output={folder}"])
    with pytest.raises(UserError):
        export(cfg)
    assert not folder.exists()

    cfg.format = "obj"
    with pytest.raises(UserError, match="format=obj; possible: stl, step"):
        export(cfg)
