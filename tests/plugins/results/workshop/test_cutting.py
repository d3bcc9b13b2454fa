"""Solids too large for the plate: parts that fit, and that put together are what was cut."""

import numpy as np
import pytest

from core.geometry import Box, Cylinder, Mesh, Pose
from plugins.results.workshop.cutting import cut
from plugins.results.workshop.printing import lay
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.solid import to_mesh, union

pytestmark = pytest.mark.slow

SMALL, FIT = Printer(plate_mm=[180.0, 180.0, 180.0]), Fit()
NO_MOUNT = np.zeros((0, 3))


def at(x, y, z, rpy=(0, 0, 0)):
    return Pose.xyz_rpy((x, y, z), rpy)


SOLIDS = {
    "bar": ((Box((0.6, 0.03, 0.02)), at(0, 0, 0)),),
    "leaning bar": ((Box((0.5, 0.022, 0.022)), at(0.1, 0.2, 0.3, (0.3, 0.5, 0.7))),),
    "sheet": ((Box((0.4, 0.3, 0.003)), at(0, 0, 0)),),
    "rod": ((Cylinder(0.012, 0.5), at(0, 0, 0, (0.4, 0, 0))),),
    "pan": (
        (Box((0.3, 0.28, 0.0015)), at(0, 0, 0)),
        (Box((0.3, 0.003, 0.07)), at(0, 0.1385, 0.034)),
        (Box((0.3, 0.003, 0.07)), at(0, -0.1385, 0.034)),
    ),
}


def parted(name):
    shapes = SOLIDS[name]
    solid = union(shapes)
    axes = np.vstack([pose.rotation.as_matrix().T for _, pose in shapes])
    return solid, *cut(solid, SMALL, FIT, axes, NO_MOUNT)


@pytest.mark.parametrize("name", SOLIDS)
def test_parts_fit_and_make_the_whole(name):
    whole, parts, joints = parted(name)
    assert len(parts) > 1
    for part in parts:
        assert to_mesh(part).is_volume
        assert len(part.decompose()) == 1
        assert lay(to_mesh(part), SMALL.plate_mm)[1]
    together = sum(parts[1:], parts[0])
    assert (together - whole).volume() < 0.01
    assert sum(part.volume() for part in parts) == pytest.approx(together.volume(), abs=0.01)  # none overlap
    assert together.volume() == pytest.approx(whole.volume(), rel=0.01)
    for joint in joints:
        assert joint.tails >= 1
        assert 0.09 * joint.section_mm2 < joint.neck_mm2 < 0.5 * joint.section_mm2


@pytest.mark.parametrize("name", ["bar", "leaning bar", "sheet", "pan"])
def test_dovetails_slide_in_and_do_not_come_apart(name):
    """One half moves square to its socket only: not along the cut's normal, and not across its tails."""
    near, far = parted(name)[1][-2:]
    shared = lambda way: (near.translate(tuple(way)) ^ far).volume()  # noqa: E731
    assert shared((0, 0, 0)) < 1e-6
    turn = SOLIDS[name][0][1].rotation.as_matrix().T
    pulled = max((*turn, *-turn), key=lambda way: way @ (to_mesh(near).center_mass - to_mesh(far).center_mass))
    ways = [way for way in np.vstack([np.eye(3), -np.eye(3), turn, -turn]) if shared(way) < 0.01]
    assert all(abs(way @ pulled) < 0.01 or way @ pulled < 0 for way in ways)
    assert shared(-2 * pulled) > 1


def test_no_cut_goes_through_the_mount():
    shapes = SOLIDS["bar"]
    held = np.array([[-40.0, 0, 0], [40.0, 0, 0]])
    boxes = [part.bounding_box() for part in cut(union(shapes), SMALL, FIT, np.eye(3), held)[0]]
    assert any(low < -40 and high > 40 for low, high in ((box[0], box[3]) for box in boxes))


def test_a_section_that_nothing_fits_is_glued_and_says_so():
    wire = Mesh.from_trimesh(Cylinder(0.002, 0.4).to_trimesh())
    solids, joints = cut(union([(wire, Pose())]), SMALL, FIT, np.eye(3), NO_MOUNT)
    assert len(solids) > 1
    assert {str(joint).split(",")[0] for joint in joints} == {"glue alone"}
