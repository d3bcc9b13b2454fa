"""Small changes of scenes, on tasks of every sort."""

import itertools
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from core.design import Tool
from core.geometry import Box, Cylinder, Pose
from core.interfaces import Condition, JointTrajectory, Rollout
from core.plugins import PluginPart, installed
from core.robot.solids import body_solids, signed_distance
from core.scene import Body, Geom, Joint, Scene, table
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from plugins.fitness.scattering import CONTACT_M, perturb, together
from tests.support.panda import ARM, FINGER_OPEN

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
GREY = (0.5, 0.5, 0.5, 1.0)

every_task = pytest.mark.parametrize(
    "name", ["CleanTable", "LiftBox", "OneBook", "SnatchCookie", "TurkeyLegs"]
)
draws = st.integers(0, 2**31)


@cache
def plain(name):
    return installed().create("task", name).scene(0)


def gaps(scene):
    """Metres between each free body and each other that is near, by their names."""
    solids = {
        body.name: tuple((solid, *solid.bounds()) for solid in body_solids(body))
        for body in scene.bodies
    }
    found = {}
    for body, other in itertools.product(scene.free, scene.bodies):
        for (a, at_a, half_a), (b, at_b, half_b) in itertools.product(
            solids[body.name], solids[other.name]
        ):
            if (
                body is not other
                and (np.abs(at_a - at_b) < half_a + half_b + 0.001).all()
            ):
                pair = body.name, other.name
                found[pair] = min(signed_distance(a, b), found.get(pair, math.inf))
    return found


def block(name, x, y, z, side=0.05, mass=1.0):
    return Body.of(name, Box((side, side, side)), (x, y, z), mass=mass, color=GREY)


# --- every task -------------------------------------------------------------------------------------------------


@every_task
@pytest.mark.parametrize("draw", [0, 1])
def test_nothing_gets_into_another_or_off_what_it_stands_on(name, draw):
    was, now = (
        gaps(plain(name)),
        gaps(perturb(plain(name), PerturbationRange(0.01, 0.1), draw)),
    )
    for pair, metres in now.items():
        assert metres > min(was.get(pair, math.inf), 1e-4) - 5e-5
    touching = [pair for pair, metres in was.items() if metres < 2e-4]
    assert touching
    assert all(now[pair] < 6e-4 for pair in touching)


@every_task
@pytest.mark.parametrize("draw", [2, 3])
def test_changes_are_small_and_level_and_what_is_fixed_stays(name, draw):
    ranges = PerturbationRange(0.004, 0.03, 0.2, 0.3)
    before, after = plain(name), perturb(plain(name), ranges, draw)
    alone = {group[0].name for group in groups(before) if len(group) == 1}
    for old, new in zip(before.bodies, after.bodies, strict=True):
        assert (new.name, new.visuals, new.collisions) == (
            old.name,
            old.visuals,
            old.collisions,
        )
        assert 0.7 * old.friction <= new.friction <= 1.3 * old.friction
        assert new.rolling_friction * old.friction == pytest.approx(
            old.rolling_friction * new.friction
        )
        if old.fixed:
            assert new.pose == old.pose
            assert new.mass == 0
            continue
        assert 0.8 * old.mass <= new.mass <= 1.2 * old.mass
        assert new.pose.position[2] == pytest.approx(old.pose.position[2], abs=1e-12)
        roll, pitch, yaw = (new.pose.rotation * old.pose.rotation.inv()).as_rotvec()
        assert (roll, pitch) == pytest.approx((0, 0), abs=1e-9)
        assert abs(yaw) <= 0.03 + 1e-9
        if old.name in alone:
            assert np.abs(new.pose.position - old.pose.position).max() <= 0.004 + 1e-12


def groups(scene):
    return together(
        scene.free, {body.name: tuple(body_solids(body)) for body in scene.bodies}
    )


@every_task
def test_something_changes_and_every_draw_is_another(name):
    before = plain(name).state().positions
    shifts = np.array(
        [
            perturb(plain(name), PerturbationRange(), draw).state().positions - before
            for draw in range(4)
        ]
    )
    assert np.abs(shifts).max() > 0.002
    for one, other in itertools.combinations(shifts, 2):
        assert not np.array_equal(one, other)


def test_what_stands_together_moves_as_one():
    # Two columns.
    assert sorted(len(group) for group in groups(plain("SnatchCookie"))) == [6, 6]
    # The pot and what lies in it.
    assert [len(group) for group in groups(plain("TurkeyLegs"))] == [6]
    assert [len(group) for group in groups(plain("OneBook"))] == [5]
    assert all(len(group) == 1 for group in groups(plain("GatherSpheres")))
    before, after = (
        plain("TurkeyLegs"),
        perturb(plain("TurkeyLegs"), PerturbationRange(), 3),
    )
    assert (
        np.linalg.norm(after["pot"].pose.position - before["pot"].pose.position) > 1e-3
    )
    for body in before.free:
        was = before["pot"].pose.inverse() @ body.pose
        now = after["pot"].pose.inverse() @ after[body.name].pose
        np.testing.assert_allclose(now.matrix, was.matrix, atol=1e-12)


@every_task
def test_a_changed_scene_is_at_rest(name):
    """In a real engine: nothing is pushed apart, nothing falls."""
    task = installed().create("task", name)
    scene = perturb(plain(name), PerturbationRange(), 1)
    still = JointTrajectory(
        np.zeros(1), ARM.home_for(task.home)[None], np.array([FINGER_OPEN])
    )
    job = Rollout(Tool(), still, seed=0, settle_s=0.4, hold_s=0.0, scene=scene)
    (outcome,) = installed().create("sim", "pybullet").rollout(task, [job])
    assert outcome.error is None
    placed = scene.state()
    assert (
        np.linalg.norm(outcome.end.positions - placed.positions, axis=-1).max() < 3e-3
    )
    assert np.abs(outcome.end.linear_velocities).max() < 0.03


@every_task
def test_no_range_no_change(name):
    scene = perturb(plain(name), PerturbationRange(0, 0, 0, 0), 7)
    for old, new in zip(plain(name).bodies, scene.bodies, strict=True):
        assert (new.pose, new.mass, new.friction) == (old.pose, old.mass, old.friction)


# --- where room is scarce ---------------------------------------------------------------------------------------


def pen(room):
    """Four fixed walls with a free block between them, which has ``room`` metres on each side."""
    wall = Pose.xyz_rpy((0.03 + room, 0, 0))
    quarters = [Pose.xyz_rpy((0, 0, 0), (0, 0, k * math.pi / 2)) for k in range(4)]
    walls = tuple(
        Geom(Box((0.01, 0.07 + 2 * room, 0.05)), quarter @ wall) for quarter in quarters
    )
    around = Body("pen", Pose.xyz_rpy((0.5, 0, 0.025)), 0.0, walls, walls)
    return Scene((table(), around, block("block", 0.5, 0, 0.025)))


@given(draw=draws)
@settings(max_examples=10)
def test_a_block_in_a_pen_moves_as_far_as_there_is_room(draw):
    scene = pen(0.002)
    moved = perturb(scene, PerturbationRange(0.05, 0.5), draw)["block"].pose
    assert np.abs(moved.position - scene["block"].pose.position).max() < 0.002
    assert not np.array_equal(moved.position, scene["block"].pose.position)


def test_a_block_without_room_stays():
    scene = pen(1e-5)
    assert (
        perturb(scene, PerturbationRange(0.05, 0.5), 0)["block"].pose
        == scene["block"].pose
    )


@given(draw=draws)
@example(draw=38675008)
@settings(max_examples=10)
def test_a_block_on_a_post_goes_on_touching_it(draw):
    post = Geom(Cylinder(0.01, 0.3), Pose.xyz_rpy((0, 0, 0.15)))
    scene = Scene(
        (
            table(),
            Body("post", Pose.xyz_rpy((0.5, 0, 0)), 0.0, (post,), (post,)),
            block("block", 0.5, 0, 0.325),
        )
    )
    moved = perturb(scene, PerturbationRange(0.2, 1.0), draw)["block"].pose.position
    assert (
        np.linalg.norm(moved[:2] - (0.5, 0)) < 0.01 + 0.025 * math.sqrt(2) + CONTACT_M
    )


# --- conditions, and bodies that hang from others ---------------------------------------------------------------


@every_task
def test_a_condition_with_a_perturbation_has_the_perturbed_scene_of_its_layout(name):
    task = PluginPart("task", name)
    condition = Condition(
        task,
        PluginPart("sim", "pybullet"),
        layout=2,
        change=Perturbation(PerturbationRange(), 1),
    )
    expected = perturb(task.shared().scene(2), PerturbationRange(), 1)
    assert (
        condition.scene().state().positions.tolist()
        == expected.state().positions.tolist()
    )
    assert condition.where == (name, "pybullet", 2, 1)


def test_bodies_move_with_what_they_hang_from_or_not_at_all():
    bodies = (
        *(table(), block("case", 0.3, 0.3, 0.025, mass=0), block("pot", 0.8, 0, 0.025)),
        *(
            block("drawer", 0.3, 0.3, 0.025),
            block("knob", 0.3, 0.3, 0.06, 0.02),
            block("lid", 0.8, 0, 0.2),
        ),
    )
    joints = (
        Joint("pull", "slider", "drawer", "case"),
        Joint("turn", "hinge", "knob", "drawer"),
    )
    scene = Scene(
        (*bodies, block("swing", 0.8, 0.4, 0.5)),
        (*joints, Joint("l", "slider", "lid", "pot")),
    )
    scene = Scene(scene.bodies, (*scene.joints, Joint("s", "hinge", "swing")))
    changed = perturb(scene, PerturbationRange(position=0.05, yaw=0.5), 3)
    assert {
        b.name
        for b, old in zip(changed.bodies, scene.bodies, strict=True)
        if b.pose != old.pose
    } == {"pot", "lid"}
    lid = changed["pot"].pose.inverse() @ changed["lid"].pose
    assert lid.position == pytest.approx([0, 0, 0.175])
    assert changed.joints == scene.joints
