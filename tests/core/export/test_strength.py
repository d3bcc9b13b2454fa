"""Beams computed by hand, against what the strength of a tool comes to."""

import numpy as np
import pytest

from core.design import Component, Tool
from core.designs.stiffness import Load
from core.export.motion import Sampled
from core.export.strength import WEIGHT, contact_loads, strength, weights
from core.geometry import Box, Pose
from core.interfaces import Recording
from core.materials import Material
from core.plugins import installed
from tests.panda import PANDA

SOLID = Material("solid", 1240, young_pa=2.5e9, strength_pa=26e6)
NEWTONS = 10.0


def bar(name, parent, top, length, thick, mass=0.1):
    """A bar that hangs down; its ``top`` is in the frame of what bears it, whose middle is at 0."""
    return Component(name, parent, Pose(np.array([0.0, 0.0, top - length / 2])), Box((thick, thick, length)), mass)


def pressed(tool, component, z, material=SOLID):
    """What a force across does at the height ``z`` under the mount."""
    load = Load("wall", NEWTONS, {component: np.array([[0.0, 0.0, z]])})
    return {row.component: row for row in strength(tool, PANDA, material, {"engine": [(1.5, [load])]})}


def inertia(thick):
    return thick**4 / 12


def test_a_cantilever_bears_and_bends_as_in_the_book():
    length, thick = 0.2, 0.02
    row = pressed(Tool((bar("post", "tool_mount", 0.0, length, thick),)), "post", -length)["post"]
    assert row.stress_pa == pytest.approx(6 * NEWTONS * length / thick**3, rel=0.05)
    assert row.bend_m == pytest.approx(NEWTONS * length**3 / (3 * SOLID.young_pa * inertia(thick)), rel=0.05)
    assert row.safety == pytest.approx(SOLID.strength_pa / row.stress_pa)
    assert row.lever_m == pytest.approx(length, rel=0.05)
    assert (row.parent, row.load, row.newtons, row.engine, row.time_s) == ("tool_mount", "wall", NEWTONS, "engine", 1.5)


def test_a_chain_of_two_bars_bears_and_bends_by_both():
    upper, lower, wide, thin = 0.15, 0.1, 0.03, 0.015
    bars = bar("upper", "tool_mount", 0.0, upper, wide), bar("lower", "upper", -upper / 2, lower, thin)
    length = upper + lower
    rows = pressed(Tool(bars), "lower", -length)
    assert rows["upper"].stress_pa == pytest.approx(6 * NEWTONS * length / wide**3, rel=0.05)
    assert rows["lower"].stress_pa == pytest.approx(6 * NEWTONS * lower / thin**3, rel=0.05)
    parts = (length**3 - lower**3) / inertia(wide) + lower**3 / inertia(thin)
    assert rows["lower"].bend_m == pytest.approx(NEWTONS * parts / 3 / SOLID.young_pa, rel=0.05)
    assert set(pressed(Tool(bars), "upper", -upper)) == {"upper"}  # what hangs below bears nothing of it


def test_walls_with_little_infill_bear_less_and_no_strength_gives_no_verdict():
    tool = Tool((bar("post", "tool_mount", 0.0, 0.2, 0.02),))
    hollow = Material("hollow", 1240, 0.2, 1.2, young_pa=2.5e9, strength_pa=26e6)
    full = 0.02**4 - 0.8 * (0.02 - 0.0024) ** 4
    row, solid = (pressed(tool, "post", -0.2, of)["post"] for of in (hollow, SOLID))
    assert row.stress_pa / solid.stress_pa == pytest.approx(0.02**4 / full, rel=0.05)
    assert pressed(tool, "post", -0.2, Material())["post"].safety is None


def test_the_weight_counts_with_the_acceleration_of_the_motion():
    tool = Tool((bar("post", "tool_mount", 0.0, 0.2, 0.02, mass=0.5),))
    times, home = np.arange(200) / 1000, np.array(PANDA.home)
    turning = np.tile(home, (200, 1))
    (load,) = weights(tool, PANDA, Sampled(times, turning, 0 * turning, 0 * turning, 0 * times))
    assert load.newtons == pytest.approx(0.5 * 9.81, rel=1e-3)
    turning[:, 0] += 2.0 * times**2 / 2  # about the upright axis: 2 rad/s^2
    (load,) = weights(tool, PANDA, Sampled(times, turning, 0 * turning, 0 * turning, 0 * times))
    radius, speed = 0.555, 2.0 * times[-2]  # of the flange from that axis, at home
    assert load.newtons == pytest.approx(0.5 * np.hypot(9.81, np.hypot(2.0 * radius, speed**2 * radius)), rel=0.02)
    assert (load.what, set(load.places)) == (WEIGHT, {"post"})


@pytest.mark.parametrize(("seconds", "share"), [(0.01, None), (1.0, 1.0)])
def test_an_impact_counts_by_its_impulse_and_what_lasts_by_its_force(seconds, share):
    """An impulse J loads a spring that holds a mass with J sqrt(k / m) at most."""
    task, length, thick, mass = installed().create("task", "MoveBall"), 0.3, 0.008, 0.05
    scene, times = task.scene(0), np.arange(301) / 100
    tool = Tool((bar("post", "tool_mount", 0.0, length, thick, mass),))
    force = np.where(np.abs(times - 1.5) <= seconds / 2 + 1e-9, 40.0, 0.0)
    force[np.abs(times - 1.5) > max(seconds / 2, 0.004)] = 0.0
    states = type(scene.state()).stack([scene.state()] * len(times))
    recording = Recording(
        times, np.tile(PANDA.home, (len(times), 1)), np.zeros((len(times), 0)), states, {("tool", "ball"): force}
    )
    found = contact_loads(scene, PANDA, tool, SOLID, recording)
    assert 1.0 <= found[0][0] <= 2.0
    newtons = max(load.newtons for _, loads in found for load in loads)
    soft = length**3 / (3 * SOLID.young_pa * inertia(thick))
    (ball,) = (body.mass for body in scene.free if body.name == "ball")
    impulse = 40.0 * 0.01 / np.sqrt(soft * min(mass, ball))
    assert newtons == pytest.approx(impulse if share is None else share * 40.0, rel=0.05)
    assert newtons <= 40.0
    assert contact_loads(scene, PANDA, tool, SOLID, Recording(times, recording.arm, recording.fingers, states)) == []
