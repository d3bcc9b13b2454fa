"""From a tool to files and back: the pieces, put together by the sheet, are the tool that was simulated."""

import json

import manifold3d
import numpy as np
import pytest
import trimesh

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Mesh, Pose
from core.plugins import installed
from plugins.results.workshop.playback import SAME_REWARD
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.sheet import figures
from plugins.results.workshop.solid import joined_solids, manifold, to_mesh, union
from plugins.results.workshop.stage import Stage
from plugins.results.workshop.tool import make_tool, write_tool
from tests.support.exports import exported
from tests.support.panda import PANDA
from tests.support.playing import condition
from tests.support.workshop_tools import HOOK, MINI, PLA

OFF_MM = 0.2


def put_together(folder, sheet):
    """The pieces of the files as one solid, a Manifold in the frame of the mount, millimetres."""
    solids = []
    for piece in sheet["pieces"]:
        mesh = trimesh.load(folder / piece["file"])
        solids.append(manifold(mesh.apply_transform(piece["to_mount"])))

    assert len(solids) == 3
    return joined_solids(solids)


def simulated(made):
    """The tool with its plate and its joints as it is simulated, a Manifold."""
    placed = made.mounted.placed()
    shapes = [(part.shape, placed[part.name][1]) for part in made.mounted.components]
    return union(shapes)


def bored(made):
    """What screws, inserts and the arm's flange take of the solids."""
    taken = [
        placed
        for body in made.bodies
        for placed in (*body.mount.taking, *body.mount.clearing)
    ]
    for joint in made.joints:
        taken += joint.tongue.taking
        taken += joint.socket.taking[
            1:
        ]  # the first is the pocket, which the tongue fills

    return union(taken)


def grown(solid):
    """All that is within 0.2 mm of a solid, a Manifold, and hardly more: a ball is taken for the cube within it."""
    side = 2 * OFF_MM / 3**0.5
    return solid.minkowski_sum(manifold3d.Manifold.cube((side,) * 3, True))


@pytest.mark.slow
@pytest.mark.thorough
def test_pieces_put_together_by_the_sheet_are_the_solid_within_a_fifth_of_a_millimetre(
    tmp_path,
):
    made = make_tool(PLA.made(HOOK), PANDA, PLA, MINI, Fit())
    write_tool(made, tmp_path, MINI)
    sheet = figures(made, [], installed().create("task", "BringCube"))
    whole = put_together(tmp_path, json.loads(json.dumps(sheet)))
    solid = simulated(made)
    bores = bored(made)
    assert (whole - bores - grown(solid)).volume() < 0.01

    # What lacks more is a number, pressed 0.4 mm deep, or the gap of 0.5 mm at the end of a tongue.
    lacking = (solid - bores - grown(whole)).decompose()
    thin = [min(np.ptp(to_mesh(piece).bounds, axis=0)) for piece in lacking]
    assert len(made.parts) + len(made.joints) == len([mm for mm in thin if mm > 0.01])
    assert max(thin) < 0.35

    # A shift by half a millimetre would be noticed.
    shifted = whole.translate((0.5, 0.0, 0.0))
    assert (shifted - bores - grown(solid)).volume() > 10


@pytest.mark.thorough
def test_what_is_printed_earns_what_was_simulated(tmp_path):
    """Each component is the hull of what the pieces have in its place."""
    found = exported(tmp_path, "material=pla", "printer=a1_mini")
    sheet = json.loads((tmp_path / "sheet.json").read_text())
    whole = put_together(tmp_path / "tool", sheet)
    mounted = found.printed.printed
    placed = mounted.placed()
    components = []
    for part in mounted.components:
        here = whole ^ union([(part.shape, placed[part.name][1])])
        corners = to_mesh(here).vertices / 1000
        shape = Mesh.hull_of(corners)
        components.append(Component(part.name, RIGID_MOUNT, Pose(), shape, part.mass))

    where = condition(found.task, installed().create("sim", "mujoco"))
    stage = Stage({"mujoco": where}, found.scene)
    again = stage.rewards(Tool(tuple(components)), found.playable)
    assert again["mujoco"] == pytest.approx(
        found.replays["mujoco"].reward, abs=SAME_REWARD
    )
