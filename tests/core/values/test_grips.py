"""What grips bear, from both sides of each limit, and what is known of what they held."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from core.geometry import Box, Cylinder
from core.scene import Body, Scene, State, Trace
from core.values.grips import FACES, GRIPS, Gripped, Limit, Load

AREA = 400.0
RADIUS = math.sqrt(AREA * 1e-6 / math.pi)
SUCTION_N = 60e3 * AREA * 1e-6 / 1.5


def worst(kind, **load):
    given = {"pull": 0.0, "shear": 0.0, "tilt": 0.0, "twist": 0.0}
    limits = GRIPS[kind]("bottom", AREA).limits(Load(**given | load))
    return max(limits, key=lambda limit: limit.share)


# Each with what it bears, by hand: the load, and the limit that it meets.
BEARS = [
    ("suction", {"pull": SUCTION_N}, "pull"),
    ("suction", {"shear": 0.5 * SUCTION_N}, "shear"),
    ("suction", {"pull": SUCTION_N / 2, "shear": 0.25 * SUCTION_N}, "shear"),
    ("suction", {"tilt": RADIUS * SUCTION_N}, "tilt"),
    ("suction", {"twist": RADIUS * SUCTION_N / 3}, "twist"),
    ("adhesive", {"pull": 690e3 / 5 * AREA * 1e-6}, "peel"),
    ("adhesive", {"tilt": 690e3 / 5 * AREA * 1e-6 * RADIUS / 4}, "peel"),
    ("adhesive", {"shear": 480e3 / 5 * AREA * 1e-6}, "shear"),
    ("adhesive", {"twist": 480e3 / 5 * AREA * 1e-6 * RADIUS / 2}, "shear"),
    ("hook_and_loop", {"pull": 16.0}, "peel"),
    ("hook_and_loop", {"shear": 32.0}, "shear"),
]


@pytest.mark.parametrize(("kind", "load", "named"), BEARS)
def test_a_load_is_borne_up_to_its_limit(kind, load, named):
    less = worst(kind, **{name: 0.999 * value for name, value in load.items()})
    more = worst(kind, **{name: 1.001 * value for name, value in load.items()})
    assert less.share < 1 < more.share
    assert less.name == more.name == named


def test_a_magnet_pulls_about_as_much_as_makers_print():
    """A disc of N42, 20 x 10 mm, holds 11 kg on thick steel."""
    magnet = GRIPS["magnet"]("bottom", 1e6 * math.pi * 0.01**2)
    assert magnet.thickness_m == pytest.approx(0.01)
    assert magnet.strength_n == pytest.approx(11 * 9.81, rel=0.05)
    assert "20.0 x 10.0 mm" in magnet.parts


def test_what_is_pressed_on_does_not_open_or_pull():
    assert worst("suction", pull=-2 * SUCTION_N, tilt=10.0).share == 0
    assert worst("suction", pull=-SUCTION_N / 2, tilt=10.0).share > 1


def test_forces_at_the_rim_are_a_load():
    """A weight that hangs off the middle pulls, and tilts by its arm; turned to the side it shears."""
    around = np.array([[RADIUS, 0.0, 0.0], [0.0, RADIUS, 0.0], [0.0, -RADIUS, 0.0]])
    down = np.diag([1.0, -1.0, -1.0])
    forces = np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    load = Load.of(forces, around, down)
    assert load.pull == pytest.approx(3.0)
    assert load.tilt == pytest.approx(3.0 * RADIUS)
    assert load.shear == pytest.approx(0.0)

    aside = Load.of(forces, around, np.array([[0, 0, 1.0], [1.0, 0, 0], [0, 1.0, 0]]))
    assert aside.pull == pytest.approx(0.0)
    assert aside.shear == pytest.approx(3.0)
    assert aside.twist == pytest.approx(3.0 * RADIUS)


@pytest.mark.parametrize("face", FACES)
def test_a_patch_lies_in_the_middle_of_its_face(face):
    place = GRIPS["magnet"](face, 100).place(Box((0.04, 0.06, 0.08)))
    out = np.array(FACES[face])
    np.testing.assert_allclose(place.position, out * [0.02, 0.03, 0.04], atol=1e-12)
    np.testing.assert_allclose(place.rotation.apply([0, 0, 1]), out, atol=1e-12)


def test_a_patch_fits_a_face_as_wide_as_it_is():
    rod = Cylinder(1.001 * RADIUS, 0.1)
    assert GRIPS["suction"]("top", AREA).fits(rod)
    assert not GRIPS["suction"]("top", 1.01 * AREA).fits(rod)


@pytest.mark.parametrize(
    ("face", "area", "words"),
    [("up", 100, "'up'"), ("top", 19.9, "19.9"), ("top", 20_001, "area_mm2")],
)
def test_what_can_not_be_is_refused(face, area, words):
    with pytest.raises(ValueError, match=words):
        GRIPS["suction"](face, area)


@pytest.mark.parametrize(
    ("kind", "has"),
    [("suction", "smooth"), ("magnet", "magnetic"), ("hook_and_loop", "loops")],
)
def test_a_surface_is_what_a_grip_needs(kind, has):
    surface = SimpleNamespace(smooth=False, magnetic=False, loops=False)
    grip = GRIPS[kind]("top", 100)
    assert grip.find_obstacle(surface)
    setattr(surface, has, True)
    assert grip.find_obstacle(surface) == ""
    assert GRIPS["adhesive"]("top", 100).find_obstacle(surface) == ""


HARDEST = Limit("pull", 12.0, 16.0, "N")


def test_what_was_held_is_said_and_has_a_margin():
    kept = Gripped("cup", "suction", "box", 1.0, hardest=HARDEST)
    (margin,) = kept.margins
    assert margin.margin == pytest.approx(0.25)
    assert str(kept) == (
        "cup (suction) held box from 1.00 s to the end; hardest was a pull of 12 N, and it bears 16 N"
    )

    lost = kept._replace(end_s=2.0, why="pull of 17 N, and it bears 16 N")
    assert lost.failed
    assert lost.margins == ()
    assert "lost it at 2.00 s: pull of 17 N" in str(lost)
    never = Gripped("cup", "suction", "box", 1.0, why="it is not smooth")
    assert "did not hold it: it is not smooth" in str(never)
    assert not never.holds(np.array([0.5, 1.5])).any()


def test_what_a_tool_grips_it_holds():
    box = Body.of("box", Box((0.1, 0.1, 0.1)), (0, 0, 1), mass=1.0, color=(1, 0, 0, 1))
    state: State = Scene((box,)).state()
    entry = Gripped("cup", "suction", "box", 0.03, 0.07, hardest=HARDEST)
    times = np.array([0.0, 0.04, 0.08])
    held = Trace.of(state, state, state, gripped={("cup", "box"): entry.holds(times)})
    assert held.support.held("box").tolist() == [False, True, False]
    assert held.support.linked("box").tolist() == [False, True, False]
