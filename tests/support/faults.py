"""An engine that breaks in a different way for each of some masses of the tool."""

from __future__ import annotations

import ctypes
import os
import signal
import time
from dataclasses import replace

import numpy as np

from core.design import Candidate, Component, Tool
from core.geometry import Box, Pose
from core.goals import Away
from core.interfaces import Ability, Outcome, RolloutSettings, Simulator, Task
from core.scene import Body, Scene, State
from tests.support import playing
from tests.support.panda import PANDA

FAULTS = ("abort", "segfault", "hang", "nan", "leak", "raise")


class Slide(Task):
    robot = PANDA
    name = "Slide"
    description = "A block."
    goals = (Away(("block",), away=0.1),)
    home = Pose.xyz_rpy((0.5, 0.0, 0.4))

    def scene(self, seed):
        block = Body.of(
            "block",
            Box((0.1, 0.1, 0.1)),
            (0.5, 0, 0.05),
            mass=1.0,
            color=(0.5, 0.5, 0.5, 1.0),
        )
        return Scene((block,))

    def reward(self, start, end):
        return np.clip(
            end.position("block")[..., 0] - start.position("block")[..., 0], 0, 1
        )


class Crowded(Slide):
    """Has its block where tools start in the layout of seed 1."""

    def scene(self, seed):
        scene = super().scene(seed)
        (block,) = scene.bodies
        there = replace(block, pose=Pose.xyz_rpy((0.5, 0.0, 0.35)))
        return replace(scene, bodies=(there,)) if seed == 1 else scene


class Faulty(Simulator):
    supports = frozenset({Ability.FORCES})

    def rollout(self, task, jobs):
        return [self.one(task, job) for job in jobs]

    def one(self, task, job):
        start = task.scene(job.seed).state()
        (rod,) = job.tool.components
        fault = round(rod.mass * 1000) - 100
        if fault > 0:
            self.break_down(FAULTS[fault - 1])
        shift = np.array(
            [rod.shape.size[2] * abs(np.sin(job.trajectory.arm[-1].sum())), 0, 0]
        )
        if fault > 0:
            shift[0] = np.nan
        end = State(
            start.names, start.positions + shift, *[np.zeros((1, n)) for n in (4, 3, 3)]
        )
        return Outcome(start, end, tracking_error_rad=0.0)

    def break_down(self, fault):
        match fault:
            case "abort":
                os.abort()
            case "segfault":
                signal.signal(signal.SIGSEGV, signal.SIG_DFL)
                ctypes.string_at(0)
            case "hang":
                time.sleep(3600)
            case "leak":
                held = []
                while True:
                    held.append(np.empty(2**23))
            case "raise":
                raise ArithmeticError("the solver gave up")

    def render(self, task, **_):
        raise NotImplementedError


def candidate(number: int, fault: str | None = None) -> Candidate:
    """Return candidate ``number``; there are two plans to a tool, whose mass chooses the fault."""
    mass = 0.1 + (0 if fault is None else FAULTS.index(fault) + 1) / 1000
    length = 0.1 + (number // 2) / 1000
    down = Pose.xyz_rpy((0.0, 0.0, -length / 2))  # clear of the arm
    tool = Tool(
        (Component("rod", "tool_mount", down, Box((0.02, 0.02, length)), mass),)
    )
    plan = np.array([[0.5, 0.001 * (number % 50), 0.42, 0, 0, 0]])
    return Candidate(tool, plan, 0, 0, number // 2, number % 2)


SLIDE = playing.condition(
    Slide(), Faulty(), settings=RolloutSettings(settle_s=0, hold_s=0)
)
"""Where such candidates are tried."""
