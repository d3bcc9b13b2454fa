"""A throw into a tray 2 m away, which no plan that rests at its waypoints can do."""

import numpy as np
import pytest

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings, Task
from core.plugins import installed
from core.scene import Body, Scene
from core.simulation.attempt import prepare
from plugins.actions.anchored import AnchoredActions
from tasks.assets import open_box
from tests.support.panda import on_panda
from tests.support.playing import evaluate_batch

pytestmark = pytest.mark.slow

GRAY = (0.6, 0.6, 0.6, 1.0)
FLOOR = -0.9
TOP = 0.5
SIDE = 0.04
CUBE = np.array([0.95, -0.2, TOP + SIDE / 2 + 0.0001])
AWAY = np.array([-1.1, 1.67])
TRAY = 0.5
WALL = 0.01


def part(name, parent, at, size, mass):
    return Component(name, parent, Pose(np.array(at)), Box(size), mass)


FORK = Tool(  # two rails between cheeks, open to the left; the post on which the cube lies fits between them
    (
        part("beam", "tool_mount", (0.285, 0.0, -0.02), (0.61, 0.03, 0.03), 0.06),
        part("drop", "beam", (0.285, -0.055, -0.03), (0.06, 0.02, 0.10), 0.02),
        part("rear", "drop", (0.0, 0.0, -0.055), (0.08, 0.012, 0.06), 0.02),
        part("near_rail", "rear", (-0.019, 0.056, -0.036), (0.012, 0.11, 0.012), 0.01),
        part("far_rail", "rear", (0.019, 0.056, -0.036), (0.012, 0.11, 0.012), 0.01),
        part("near_cheek", "rear", (-0.036, 0.05, -0.01), (0.01, 0.10, 0.05), 0.01),
        part("far_cheek", "rear", (0.036, 0.05, -0.01), (0.01, 0.10, 0.05), 0.01),
    )
)
# From the mount to the cube on the rails, ahead and down.
REACH = 0.57
RAIL = 0.135


class Throw(Task):
    name = "Throw"
    description = "Throw the cube, which lies on a post, into the tray."
    goals = ()
    home = Pose.xyz_rpy((0.45, -0.3, 0.7))

    def scene(self, seed):
        ground = Body.of(
            "ground",
            Box((8.0, 8.0, 0.1)),
            (0.0, 0.0, FLOOR - 0.05),
            mass=0.0,
            color=GRAY,
        )
        height = TOP - FLOOR
        post = Body.of(
            "post",
            Box((0.016, 0.016, height)),
            (*CUBE[:2], TOP - height / 2),
            mass=0.0,
            color=GRAY,
        )
        cube = Body.of(
            "cube",
            Box((SIDE,) * 3),
            CUBE,
            mass=0.05,
            color=(0.8, 0.1, 0.1, 1.0),
            friction=0.8,
        )
        walls = open_box(TRAY, TRAY, 0.12, WALL, (0.2, 0.4, 0.7, 1.0))
        tray = Body(
            "tray",
            Pose.xyz_rpy((*(CUBE[:2] + AWAY), FLOOR)),
            0.0,
            walls,
            walls,
            friction=1.0,
        )
        block = Body.of(
            "block",
            Box((0.3, 0.3, -FLOOR)),
            (0.0, 0.0, FLOOR / 2 - 0.002),
            mass=0.0,
            color=GRAY,
        )
        return Scene((ground, block, post, cube, tray))

    def reward(self, start, end):
        x, y, z = np.moveaxis(np.abs(end.relative("cube", "tray")), -1, 0)
        return ((np.maximum(x, y) < TRAY / 2 - WALL) & (z < 0.12)).astype(float)


def throw(tempo):
    """Take the cube from below, swing back, and swing about the base until the arm stops and the cube flies on."""
    turns = np.radians(np.linspace(-35, 29, 8)).tolist()
    yaws = np.radians(np.linspace(-105, 49, 8)).tolist()
    swing = [
        {
            "offset": [0.5 * np.cos(turn), 0.5 * np.sin(turn), 0.8],
            "rpy": [0.0, 0.0, yaw],
        }
        for turn, yaw in zip(turns, yaws, strict=True)
    ]
    fast = [
        place | {"speed": 3.0, "through": k < 6} for k, place in enumerate(swing[1:])
    ]
    take = [
        {"anchor": "cube", "offset": [-REACH, -0.12, RAIL - 0.035]},
        {"anchor": "cube", "offset": [-REACH, 0.02, RAIL - 0.035]},
        {"anchor": "cube", "offset": [-REACH, 0.02, RAIL + 0.12]},
    ]
    return AnchoredActions().parse(
        [*take, swing[0], *(fast if tempo else swing[1:])], gripper=False
    )


@pytest.mark.parametrize("engine", ["pybullet", "sapien", "mujoco"])
def test_a_throw_needs_its_tempo(engine):
    task = on_panda(Throw())
    settings = RolloutSettings(hold_s=2.0)
    assert np.linalg.norm(AWAY) >= 1.99
    candidates = [
        Candidate(FORK, throw(tempo=True)),
        Candidate(FORK, throw(tempo=False), action=1),
    ]
    thrown, carried = evaluate_batch(
        task, installed().create("sim", engine), candidates, settings=settings
    )
    assert (thrown.status, thrown.reward) == ("ok", 1.0)
    assert (carried.status, carried.reward) == ("ok", 0.0)
    motion, _ = prepare(task, candidates[0], 0, settings)
    speeds = (
        np.abs(np.diff(motion.trajectory.arm, axis=0))
        / np.diff(motion.trajectory.times)[:, None]
    )
    assert (
        speeds.max(axis=0) <= 1.001 * 0.95 * np.array([2.175] * 4 + [2.61] * 3)
    ).all()
