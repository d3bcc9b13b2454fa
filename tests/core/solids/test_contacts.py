"""Contacts from recordings made on purpose; in real engines they are in `test_observing.py`."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Component, Tool
from core.geometry import Box, Mesh, Pose, Sphere
from core.scene import Bond, Joint, Scene
from core.simulation.observing import list_contacts
from core.solids.contacts import HULL_M, TOUCH_M, find_contacts, make_trace
from core.solids.penetration import findings
from tests.support.panda import ARM, PANDA
from tests.support.recordings import HZ, ROD, body, recording, straight

CUBE = Box((0.1, 0.1, 0.1))
HULL = Mesh.from_trimesh(CUBE.to_trimesh())


def contacts(paths, *bodies, tool=ROD, **given):
    scene = Scene(bodies)
    return find_contacts(scene, PANDA, tool, recording(scene, paths, **given))


def there_and_back(gap, count=21):
    """A way along x that ends, in its middle, ``gap`` before a wall at x = 0.5 for a cube of 0.1 m, then back."""
    way = np.zeros((count, 3))
    way[:, 0] = 0.45 - gap - np.abs(np.linspace(-0.2, 0.2, count))
    return way


@pytest.mark.parametrize(("shape", "most"), [(CUBE, TOUCH_M), (HULL, TOUCH_M + HULL_M)])
def test_things_are_in_contact_up_to_the_gap_that_engines_leave(shape, most):
    wall = body("wall", Box((0.1, 1.0, 1.0)), (0.55, 0, 0), mass=0.0)
    cube = body("cube", shape, (0, 0, 0))
    found = contacts({"cube": there_and_back(most - 1e-5)}, wall, cube)
    ((key, touched),) = found.touching.items()
    assert key == ("body", "cube", "wall")
    assert np.flatnonzero(touched).tolist() == [10]
    assert found.depths[key] == pytest.approx(1e-5 - most, abs=1e-6)
    assert list_contacts(found)[0].force_n is None
    assert not contacts({"cube": there_and_back(most + 1e-5)}, wall, cube).touching


def test_what_rests_on_something_from_the_start_is_no_new_contact():
    ground = body("ground", Box((4.0, 4.0, 0.1)), (0, 0, -0.05), mass=0.0)
    cube, post = (
        body("cube", CUBE, (0, 0, 0.05)),
        body("post", CUBE, (1.0, 0, 0.05), mass=0.0),
    )
    found = contacts(
        {"cube": straight((0, 0, 0.05), (0.9, 0, 0.05), 30)}, ground, cube, post
    )
    assert [contact.other for contact in list_contacts(found)] == ["post"]
    assert ("body", "cube", "ground") in found.touching


def test_a_body_that_is_struck_between_two_samples_was_in_contact():
    """A ball flies away between two samples, so that at neither the two are nearer than a centimetre."""
    club, ball = body("club", CUBE, (0, 0, 0)), body("ball", Sphere(0.05), (0.2, 0, 0))
    club_x = np.array([0.0, 0.04, 0.08, 0.12, 0.16])
    ball_x = np.array([0.2, 0.2, 0.2, 0.24, 0.32])
    paths = {"club": np.outer(club_x, [1, 0, 0]), "ball": np.outer(ball_x, [1, 0, 0])}
    speeds = np.zeros((5, 3))
    speeds[3:, 0] = 2.0
    (found,) = list_contacts(contacts(paths, club, ball, velocities={"ball": speeds}))
    assert {found.one, found.other} == {"club", "ball"}
    assert found.first_s == pytest.approx(3 / HZ)
    assert not contacts(paths, club, ball).touching  # if its velocity had not changed


def test_contacts_of_tool_and_arm_are_told_apart_and_the_rest_has_a_clearance():
    """Between the two instants the arm turns about its base, so that the rod sweeps over a post, or a link does."""
    joints = np.repeat(ARM.home[None], 21, axis=0)
    joints[:, 0] += np.linspace(-0.5, 0.5, 21)
    rod = Tool(
        (
            Component(
                "rod",
                "tool_mount",
                Pose.xyz_rpy((0.0, 0.0, -0.1)),
                Box((0.02, 0.02, 0.2)),
            ),
        )
    )
    low = body("low", Box((0.05, 0.05, 0.32)), (0.5, 0, 0.16), mass=0.0)
    high = body("high", Box((0.05, 0.05, 0.1)), (0.5, 0, 0.6), mass=0.0)
    aside = body("aside", Box((0.05, 0.05, 0.2)), (0.5, 0, 0.19), mass=0.0)
    free = body("free", Sphere(0.01), (2.0, 0, 0))
    found = contacts(
        {"free": np.tile([2.0, 0, 0], (21, 1))},
        low,
        high,
        aside,
        free,
        tool=rod,
        arms=joints,
    )
    assert {(kind, other) for kind, _, other in found.touching} == {
        ("tool", "low"),
        ("arm", "high"),
    }
    assert found.with_robot("low")[10]
    assert not found.with_robot("low")[[0, -1]].any()
    assert found.approaches.keys() == {"aside", "free"}
    assert found.approaches["aside"].gap_m == pytest.approx(0.01, abs=1e-4)


def test_touches_before_the_motion_and_between_two_samples_count():
    """The rod sweeps over a post before 0, and presses another one only between two samples."""
    joints = np.repeat(ARM.home[None], 21, axis=0)
    joints[:, 0] += np.linspace(-0.5, 0.5, 21)
    low = body("low", Box((0.05, 0.05, 0.32)), (0.5, 0, 0.16), mass=0.0)
    aside, free = (
        body("aside", Sphere(0.01), (0.5, 0.1, 0.1), mass=0.0),
        body("free", Sphere(0.01), (2.0, 0, 0)),
    )
    scene = Scene((low, aside, free))
    taken = recording(scene, {"free": np.tile([2.0, 0, 0], (21, 1))}, arms=joints)
    pressed = {
        ("tool", "aside"): np.eye(21)[18],
        ("tool", "low"): 30.0 * np.eye(21)[10],
    }
    film = replace(taken, times=taken.times - 0.6, forces=pressed)
    trace = make_trace(scene, find_contacts(scene, PANDA, ROD, film))
    assert trace.touched("low", "robot")
    assert trace.touched("aside", "tool")
    assert trace.first_s("low", "rod") == 0.0
    assert trace.force_n("low", "robot") == 30.0
    assert trace.first_s("aside", "robot") == pytest.approx(18 / HZ - 0.6)
    assert not trace.touched("free", "robot").any()


def test_a_body_is_held_by_one_that_the_robot_touches():
    joints = np.repeat(ARM.home[None], 3, axis=0)
    tray, egg = (
        body("tray", CUBE, (0.5, 0, 0.25)),
        body("egg", Sphere(0.02), (0.56, 0, 0.32)),
    )
    still = {
        "tray": np.tile([0.5, 0, 0.25], (3, 1)),
        "egg": np.tile([0.54, 0, 0.32], (3, 1)),
    }
    scene = Scene((tray, egg))
    found = find_contacts(scene, PANDA, ROD, recording(scene, still, arms=joints))
    assert not found.with_robot("egg").any()
    assert make_trace(scene, found).support.linked("egg").all()


def test_without_motion_or_bodies_nothing_touches():
    assert not contacts(
        {"cube": np.zeros((1, 3))}, body("cube", CUBE, (0, 0, 0))
    ).touching
    scene = Scene(())
    nothing = recording(scene, {"nothing": np.zeros((3, 3))})
    assert not find_contacts(scene, PANDA, ROD, nothing).touching


def test_bodies_that_a_joint_connects_are_in_no_contact():
    wall, cube = (
        body("wall", Box((0.1, 1.0, 1.0)), (0.55, 0, 0), mass=0.0),
        body("cube", CUBE, (0.2, 0, 0)),
    )
    film = recording(Scene((wall, cube)), {"cube": there_and_back(-0.08)})
    assert find_contacts(Scene((wall, cube)), PANDA, ROD, film).touching
    joined = Scene(
        (wall, cube), (Joint("slide", "slider", "cube", "wall", axis=(1, 0, 0)),)
    )
    assert not find_contacts(joined, PANDA, ROD, film).touching
    assert findings(joined, PANDA, ROD, film) == []
    assert findings(Scene((wall, cube)), PANDA, ROD, film)


def test_a_trace_counts_from_the_beginning_of_the_motion():
    wall, cube = (
        body("wall", Box((0.1, 1.0, 1.0)), (0.55, 0, 0), mass=0.0),
        body("cube", CUBE, (0.2, 0, 0)),
    )
    scene = Scene((wall, cube))
    film = recording(scene, {"cube": there_and_back(0)}, hz=50)
    forces = {("wall", "cube"): np.linspace(0, 20, 21)}
    film = replace(film, times=film.times - 0.1, forces=forces)
    world = find_contacts(scene, PANDA, ROD, film)
    trace = make_trace(scene, world)
    assert trace.times == pytest.approx(np.arange(9) / 25)
    assert trace.touched("cube", "wall")
    assert trace.first_s("cube") == pytest.approx(0.1, abs=0.021)
    assert trace.states.position("cube")[0, 0] == pytest.approx(
        film.states.position("cube")[5, 0], abs=0.021
    )
    # The mean of the last two samples.
    assert trace.force_n("cube") == pytest.approx(19.5)
    (contact,) = list_contacts(world)
    assert contact.force_n == pytest.approx(9.5, abs=1.01)  # while it lasts
    assert "wall" in trace.states.places


@pytest.mark.parametrize(
    ("load", "force", "strain", "broken"),
    [(4.9, 14.0, 0.98, False), (5.1, 16.0, 1.02, True)],
)
def test_a_trace_keeps_what_broke_in_its_last_step(load, force, strain, broken):
    """A bond breaks there; a body breaks where it is pressed."""
    cube = replace(body("cube", CUBE, (0.2, 0, 0)), breaks_n=15.0)
    wall = body("wall", Box((0.1, 1.0, 1.0)), (0.55, 0, 0), mass=0.0)
    scene = Scene((wall, cube), bonds=(Bond("glue", "cube", 5.0),))
    film = recording(scene, {"cube": there_and_back(0)[:10]}, hz=50)
    forces = {("wall", "cube"): np.full(10, force)}
    loads = {"glue": np.append(np.ones(9), load)}
    film = replace(film, forces=forces, loads=loads)
    trace = make_trace(scene, find_contacts(scene, PANDA, ROD, film))
    assert trace.strain("glue")[-1] == pytest.approx(strain)
    assert (trace.strain("cube")[-1] > 1) == broken
    assert trace.strain("glue").shape == trace.times.shape
    with pytest.raises(KeyError, match="wall"):
        trace.strain("wall")


def test_a_bond_has_its_load_where_what_it_holds_is_touched_and_not_pressed():
    cube = body("cube", CUBE, (0.2, 0, 0))
    wall = body("wall", Box((0.1, 1.0, 1.0)), (0.55, 0, 0), mass=0.0)
    scene = Scene((wall, cube), bonds=(Bond("glue", "cube", 5.0),))
    film = recording(scene, {"cube": there_and_back(0)}, hz=50)
    film = replace(film, loads={"glue": np.full(21, 2.0)})
    trace = make_trace(scene, find_contacts(scene, PANDA, ROD, film))
    assert trace.touched("cube", "wall").all()
    assert trace.force_n("cube").max() == 0
    assert trace.strain("glue").max() == pytest.approx(0.4)
