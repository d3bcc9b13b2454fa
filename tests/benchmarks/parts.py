"""What does a tool of many convex parts cost? ``python -m tests.benchmarks.parts sims=mujoco,pybullet repeats=5``.

A beam with a curved blade of ``parts`` convex parts brings BringCube's cube, and one with a blade of boxes does the
same motion: six boxes in all. Each engine tries both in turns; times are processor time, the smallest of ``repeats``,
of whole rollouts: building the world, the motion, and the checks.
"""

from __future__ import annotations

import itertools
import math
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh

from core.design import RIGID_MOUNT, Candidate, Component, Tool
from core.designs.rules import SpawnRules, check_tool
from core.geometry import Box, Compound, Mesh, Pose
from core.interfaces import RolloutSettings, Simulator
from core.plugins import installed
from core.simulation.rollout import evaluate_batch
from core.support.cli import arguments, command
from tests.benchmarks import measuring

USAGE = "usage: python -m tests.benchmarks.parts [sims=NAME,...] [parts=N] [repeats=N] [page=FILE.md]"
PLAN = [[0.675, 0.0, 0.5, 0.0, 0.0, 0.0], [0.675, 0.0, 0.33, 0.0, 0.0, 0.0], [0.255, 0.0, 0.33, 0.0, 0.0, 0.0]]
_BENT, _RADIUS, _WALL, _HEIGHT = 2.0, 0.08, 0.01, 0.28  # of the curved blade: its angle in radians, and metres


@dataclass
class Settings:
    sims: list[str] = field(default_factory=lambda: ["pybullet", "sapien", "mujoco"])
    parts: int = 32
    repeats: int = 5
    page: str | None = None


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    text = table(given)
    sys.stdout.write(text)
    if given.page is not None:
        measuring.write_page(Path(given.page), "parts", text)


def table(given: Settings) -> str:
    task, lines = (
        installed().create("task", "BringCube"),
        [
            f"| engine | 6 boxes, s | {given.parts} convex parts, s | times as much | rewards |",
            "|---|---|---|---|---|",
        ],
    )
    tools = boxes(), curved(given.parts)
    for tool in tools:
        check_tool(tool, task.robot)
        SpawnRules(task, 0).check(tool)
    for name in given.sims:
        simulator: Simulator = installed().create("sim", name)
        times: tuple[list[float], list[float]] = [], []
        rewards = [0.0, 0.0]
        for _, (which, tool) in itertools.product(range(given.repeats), enumerate(tools)):
            candidate = Candidate(tool, np.array(PLAN))
            began = time.process_time()
            (evaluation,) = evaluate_batch(task, simulator, [candidate], 0, RolloutSettings())
            times[which].append(time.process_time() - began)
            rewards[which] = evaluation.reward
        few, many = map(min, times)
        lines.append(f"| {name} | {few:.3f} | {many:.3f} | {many / few:.2f} | {rewards[0]:.3f}, {rewards[1]:.3f} |")
    return "\n".join(lines) + "\n"


def boxes() -> Tool:
    """Make the beam with a blade of five boxes, the middle one first."""
    components, poses = [_BEAM], [_BEAM.pose]
    for number, (share, parent) in enumerate(((0.0, 0), (-0.25, 1), (0.25, 1), (-0.5, 2), (0.5, 3))):
        angle = share * _BENT
        out = np.array([-math.cos(angle), math.sin(angle), 0.0]) * (_RADIUS + _WALL / 2)
        poses.append(Pose.xyz_rpy(_CENTER + out, (0.0, 0.0, -angle)))
        size = Box((_WALL, 1.5 * _RADIUS * _BENT / 5, _HEIGHT))
        local = poses[parent].inverse() @ poses[-1]
        components.append(Component(f"blade_{number}", components[parent].name, local, size))
    return Tool(tuple(components))


def curved(parts: int) -> Tool:
    """Make the beam with a blade of one solid in so many convex parts."""
    pieces = []
    for first, last in itertools.pairwise(np.linspace(-_BENT / 2, _BENT / 2, parts + 1)):
        rim = [(-r * math.cos(a), r * math.sin(a)) for r in (_RADIUS, _RADIUS + _WALL) for a in (first, last)]
        points = np.array([(x, y, z) for x, y in rim for z in (-_HEIGHT / 2, _HEIGHT / 2)])
        pieces.append(Mesh.from_trimesh(trimesh.PointCloud(points).convex_hull))
    whole = trimesh.boolean.union([piece.to_trimesh() for piece in pieces], engine="manifold")
    shape = Compound(Mesh.from_trimesh(whole), tuple(pieces))
    return Tool((_BEAM, Component("blade", "beam", _BEAM.pose.inverse() @ Pose(_CENTER), shape, 0.025)))


_BEAM = Component("beam", RIGID_MOUNT, Pose(np.array([0.175, 0.0, -0.01])), Box((0.41, 0.03, 0.02)))
_CENTER = np.array([0.465, 0.0, -0.01 - _HEIGHT / 2])  # of the blade's curve


if __name__ == "__main__":
    command(lambda _: main())
