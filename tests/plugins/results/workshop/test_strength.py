"""Beams computed by hand, against what the strength of a tool comes to."""

from dataclasses import replace

import numpy as np
import pytest

from core.design import Tool
from core.errors import UserError
from core.interfaces import Pushes, Recording
from core.plugins import installed
from core.robot.kinematics import link_frames
from plugins.results.workshop.loads import Instant, Load, contact_loads, weights
from plugins.results.workshop.motion import Sampled
from plugins.results.workshop.strength import strength
from tests.support.panda import PANDA
from tests.support.workshop_tools import NEWTONS, SOLID, bar


def across(component, z, newtons=NEWTONS, what="wall"):
    """A force along y at the height ``z`` under the mount."""
    return Load(what, component, np.array([0.0, 0.0, z]), np.array([0.0, newtons, 0.0]))


def pressed(tool, *loads, material=SOLID):
    instant = Instant(1.5, list(loads))
    return {
        row.component: row
        for row in strength(tool, PANDA, material, {"engine": [instant]})
    }


def inertia(thick):
    return thick**4 / 12


def test_a_chain_of_two_bars_bears_and_bends_by_both():
    upper = 0.15
    lower = 0.1
    wide = 0.03
    thin = 0.015
    bars = (
        bar("upper", "tool_mount", 0.0, upper, wide),
        bar("lower", "upper", -upper / 2, lower, thin),
    )
    length = upper + lower
    rows = pressed(Tool(bars), across("lower", -length))
    assert rows["upper"].stress_pa == pytest.approx(
        6 * NEWTONS * length / wide**3, rel=0.05
    )
    assert rows["lower"].stress_pa == pytest.approx(
        6 * NEWTONS * lower / thin**3, rel=0.05
    )
    parts = (length**3 - lower**3) / inertia(wide) + lower**3 / inertia(thin)
    assert rows["lower"].bend_m == pytest.approx(
        NEWTONS * parts / 3 / SOLID.young_pa, rel=0.05
    )
    # What hangs below bears nothing of it.
    assert set(pressed(Tool(bars), across("upper", -upper))) == {"upper"}


def test_forces_that_oppose_each_other_do_so_in_each_section():
    """A lever over a fulcrum: the moment is largest there, and 0 where it is held, if forces balance about that."""
    length = 0.3
    thick = 0.02
    tool = Tool((bar("post", "tool_mount", 0.0, length, thick),))
    load = across("post", -length)
    row = pressed(tool, load, across("post", -0.2, -1.5 * NEWTONS, "fulcrum"))["post"]
    assert row.stress_pa == pytest.approx(6 * NEWTONS * 0.1 / thick**3, rel=0.05)
    assert (row.load, row.newtons) == ("wall", NEWTONS)
    assert row.lever_m == pytest.approx(0.1, rel=0.05)
    twice = pressed(tool, load, across("post", -length, what="other"))["post"]
    assert twice.stress_pa == pytest.approx(2 * pressed(tool, load)["post"].stress_pa)
    assert (
        pressed(tool, load, across("post", -length, -NEWTONS, "other"))[
            "post"
        ].stress_pa
        < 1
    )


def test_the_weight_counts_with_the_acceleration_of_the_motion():
    tool = Tool((bar("post", "tool_mount", 0.0, 0.2, 0.02, mass=0.5),))
    times = np.arange(200) / 1000
    home = np.array(PANDA.home)
    turning = np.tile(home, (200, 1))
    ((name, center, pulls),) = weights(
        tool, PANDA, Sampled(times, turning, 0 * turning, 0 * turning, 0 * times)
    )
    assert (name, center.tolist()) == ("post", [0, 0, -0.1])
    # The mount's z points up at home.
    assert pulls[100] == pytest.approx([0, 0, -0.5 * 9.81], abs=0.01)
    turning[:, 0] += 2.0 * times**2 / 2  # about the upright axis: 2 rad/s^2
    ((*_, pulls),) = weights(
        tool, PANDA, Sampled(times, turning, 0 * turning, 0 * turning, 0 * times)
    )
    mount = link_frames(PANDA, Tool(), home[None], np.zeros((1, 0)))["tool_mount"][1]
    radius = np.linalg.norm(mount[0, :2])
    speed = 2.0 * times[-2]
    assert np.linalg.norm(pulls[-2, :2]) == pytest.approx(
        0.5 * np.hypot(2.0 * radius, speed**2 * radius), rel=0.02
    )
    assert pulls[-2, 2] == pytest.approx(-0.5 * 9.81, rel=0.01)


def filmed(tool, force, way=(0.0, 10.0, 0.0)):
    """The arm at home for 3 s, and a ball that pushes the end of a post 0.3 m long, newtons (T,)."""
    task = installed().create("task", "MoveBall")
    scene = task.scene(0)
    times = np.arange(len(force)) / 100
    states = type(scene.state()).stack([scene.state()] * len(times))
    arm = np.tile(PANDA.home, (len(times), 1))
    frames = link_frames(PANDA, Tool(), arm[:1], np.zeros((1, 0)))["tool_mount"]
    at = frames[1][0] + frames[0][0] @ [0.0, 0.0, -0.3]
    samples = np.flatnonzero(force)
    forces = np.outer(force[samples], way) / np.linalg.norm(way)
    pushes = Pushes(
        samples, np.full(len(samples), "ball"), np.tile(at, (len(samples), 1)), forces
    )
    return scene, Recording(
        times, arm, np.zeros((len(times), 0)), states, {("tool", "ball"): force}, pushes
    )


@pytest.mark.parametrize(("seconds", "share"), [(0.01, None), (1.0, 1.0)])
def test_an_impact_counts_by_its_impulse_and_what_lasts_by_its_force(seconds, share):
    """An impulse J loads a spring that holds a mass with J sqrt(k / m) at most."""
    length = 0.3
    thick = 0.008
    mass = 0.05
    times = np.arange(301) / 100
    tool = Tool((bar("post", "tool_mount", 0.0, length, thick, mass),))
    force = np.where(np.abs(times - 1.5) <= max(seconds / 2, 0.004), 40.0, 0.0)
    scene, recording = filmed(tool, force)
    found = contact_loads(scene, PANDA, tool, SOLID, recording)
    assert 1.0 <= found[0][0] <= 2.0
    newtons = max(np.linalg.norm(load.force) for _, loads in found for load in loads)
    soft = length**3 / (3 * SOLID.young_pa * inertia(thick))
    (ball,) = (body.mass for body in scene.free if body.name == "ball")
    impulse = 40.0 * 0.01 / np.sqrt(soft * min(mass, ball))
    assert newtons == pytest.approx(
        impulse if share is None else share * 40.0, rel=0.05
    )
    assert newtons <= 40.0


def test_a_push_is_on_the_component_that_it_touches_in_its_mount_s_frame():
    upper = bar("upper", "tool_mount", 0.0, 0.15, 0.03)
    lower = bar("lower", "upper", -0.075, 0.15, 0.015)
    tool = Tool((upper, lower))
    force = np.zeros(301)
    force[150:160] = 8.0
    scene, recording = filmed(tool, force, (0.0, 0.0, 1.0))
    for _, loads in contact_loads(scene, PANDA, tool, SOLID, recording):
        (load,) = loads
        assert (load.what, load.component) == ("ball", "lower")
        assert load.point == pytest.approx([0, 0, -0.3], abs=1e-6)
        assert load.force == pytest.approx([0, 0, 8], abs=1e-3)
    assert contact_loads(scene, PANDA, tool, SOLID, replace(recording, forces={})) == []
    with pytest.raises(UserError, match="not where"):
        contact_loads(scene, PANDA, tool, SOLID, replace(recording, pushes=None))
