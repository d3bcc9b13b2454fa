"""A rope or a cloth that comes out on the other side of a thing went through it; what bends around it did not."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from core.geometry import Box, Cylinder, Pose
from core.robot.kinematics import arm_of
from core.scene import Body, Cloth, Elastic, Geom, Rope, Scene, Soft
from core.solids.penetration import findings
from tests.support.boxes import hanging, rigid
from tests.support.panda import PANDA
from tests.support.recordings import recording

ARM = arm_of(PANDA)
SOFT = Elastic(900, 1e6)
HZ = 100.0
TIP = ARM.forward(ARM.home).apply((0.0, 0.0, -0.15))  # in the tool, 50 mm above its end
ROPE = Rope(((0.0, -0.1, 0.0), (0.0, 0.1, 0.0)), 9, thickness=0.006)
CLOTH = Cloth((0.2, 0.2), (6, 6))


def play(form, shifts, shape=None, scene=()):
    """Move a soft body by ``shifts`` (T, 3) from the tool's part, in a straight line between two of them."""
    count = len(shifts)
    soft = Soft.make("soft", form, SOFT, Pose(TIP + shifts[0]), color=(1, 1, 1, 1))
    there = Scene((soft, *scene))
    arms = np.tile(ARM.home, (count, 1))
    seen = recording(there, {"soft": TIP + shifts}, hz=HZ, arms=arms)
    nodes = form.nodes + (TIP + shifts)[:, None]
    seen = replace(seen, states=replace(seen.states, soft={"soft": nodes}))
    tool = hanging(shape) if shape is not None else rigid()

    return [
        finding.text
        for finding in findings(there, PANDA, tool, seen)
        if finding.penetration
    ]


def along(axis, *stops, samples=20):
    """Go along an axis (3,) from stop to stop, metres: (T, 3)."""
    ways = [np.linspace(a, b, samples) for a, b in itertools.pairwise(stops)]
    return np.concatenate(ways)[:, None] * np.array(axis, dtype=np.float64)


X = (1.0, 0.0, 0.0)
Z = (0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    "shape",
    [Box((0.004, 0.004, 0.2)), Box((0.003, 0.05, 0.2)), Cylinder(0.005, 0.2)],
    ids=["bar", "blade", "round"],
)
@pytest.mark.parametrize("form", [ROPE, CLOTH], ids=["rope", "cloth"])
@pytest.mark.parametrize("samples", [3, 40], ids=["fast", "slow"])
def test_what_comes_out_on_the_other_side_went_through(shape, form, samples):
    if form is CLOTH:  # level, over the end of the tool: it is pierced
        rest = np.zeros((20, 3))
        shifts = np.concatenate([along(Z, -0.08, 0.0, samples=samples), rest])
    else:
        shifts = along(X, 0.03, -0.03, samples=samples)

    (text, *_) = play(form, shifts, shape)
    assert text.startswith("the soft 'soft' went through 'blade' at 0.")


@pytest.mark.parametrize("shape", [Box((0.004, 0.004, 0.2)), Cylinder(0.005, 0.2)])
def test_what_presses_and_goes_back_did_not(shape):
    shifts = along(X, 0.03, 0.001, 0.03)
    assert play(ROPE, shifts, shape) == []


def test_what_goes_by_below_the_end_did_not():
    shifts = along(X, 0.03, -0.03) - np.array([0.0, 0.0, 0.055])
    assert play(ROPE, shifts, Box((0.004, 0.004, 0.2))) == []


def test_a_cloth_that_a_plate_presses_may_give_way_by_a_little():
    shifts = along(Z, -0.06, -0.048, -0.048, -0.06)
    assert play(CLOTH, shifts, Box((0.05, 0.05, 0.2))) == []


def make_ring(at, inner=0.02, thick=0.006, sides=12):
    """Make a ring around y, of boxes."""
    middle = inner + thick / 2
    side = 2 * middle * np.tan(np.pi / sides) + thick
    walls = []
    for angle in np.arange(sides) * 2 * np.pi / sides:
        place = (middle * np.sin(angle), 0.0, middle * np.cos(angle))
        pose = Pose.xyz_rpy(place, (0.0, angle, 0.0))
        walls.append(Geom(Box((side, thick, thick)), pose, (1, 1, 1, 1)))
    return Body("ring", Pose(at), 0.0, tuple(walls), tuple(walls))


@pytest.mark.parametrize("samples", [3, 40], ids=["fast", "slow"])
@pytest.mark.parametrize(("far", "through"), [(0.018, False), (0.04, True)])
@pytest.mark.parametrize("axis", [X, Z, (0.6, 0.0, 0.8)], ids=["x", "z", "corner"])
def test_a_rope_may_press_a_ring_from_within_and_run_through_it(
    axis, far, through, samples
):
    """It presses the wall by 1 mm, and slides along it; or it leaves the ring through its wall."""
    away = np.array([0.3, 0.0, 0.0])
    aside = along(axis, 0.0, far, samples=samples)
    runs = along((0.0, 1.0, 0.0), 0.0, 0.08, -0.08, samples=samples) + aside[-1]
    shifts = np.concatenate([aside, runs, aside[::-1]]) + away

    texts = play(ROPE, shifts, scene=(make_ring(TIP + away),))
    assert bool(texts) == through
    assert all(text.startswith("the soft 'soft' went through 'ring'") for text in texts)


def test_a_rope_that_is_pulled_through_the_wall_of_a_ring_went_through_it():
    shape = Box((0.012, 0.1, 0.01))
    wall = Geom(shape, Pose(), (1, 1, 1, 1))
    at = TIP + np.array([0.3, 0.0, 0.0])
    ring = Body("ring", Pose(at), 0.0, (wall,), (wall,))

    shifts = along(Z, 0.03, -0.03) + np.array([0.3, 0.0, 0.0])
    (text,) = play(ROPE, shifts, scene=(ring,))
    assert text.startswith("the soft 'soft' went through 'ring'")
