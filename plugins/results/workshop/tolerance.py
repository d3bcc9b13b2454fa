"""Try a tool as it may come out: with dimensions that are off, and bent as its hardest load bends it.

Engines take a tool to be rigid and exact. What works only by a fit closer than a printer's tolerance, or where it would
bend into what it passes, fails here.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Component, Tool
from core.geometry import Pose
from core.solids.contacts import nearest
from core.solids.record_rate import subset
from core.support.templates import macros
from plugins.results.workshop.export import Export
from plugins.results.workshop.printing import Check
from plugins.results.workshop.replay import Unplayable
from plugins.results.workshop.stage import Stage
from plugins.results.workshop.strength import Strength
from plugins.results.workshop.tracks import body_tracks, robot_tracks

LOSS = 0.1
"""Of the reward, that a tool may lose where it comes out otherwise."""

THINNEST_M = 1e-4
WINDOW_S = 0.25  # before and after a load, in which what is near counts
EVERY = 4  # of the recording's instants one is looked at


def check_tolerance(export: Export, stage: Stage, off_m: float) -> list[Check]:
    """Play an exported motion with the tool as it may come out, and look what a bent one meets.

    Args:
        export: the motion, the tool, and what its components bear.
        stage: where it is played, in the first engine.
        off_m: by how much dimensions may be off, metres.
    """
    tool = export.printed.printed
    engine = next(iter(stage.conditions))

    def earn(variant: Tool) -> float:
        try:
            return stage.play_in(engine, variant, export.playable).reward
        except Unplayable:
            return 0.0

    asked = export.mounted[engine]
    earned = [earn(variant) for variant in draw_tools(tool, off_m)]
    bent = None
    softest = max(export.strengths, key=lambda row: row.bend_m)
    if softest.bend_m > off_m:
        bent = earn(bend_tool(tool, softest))

    least = min(earned) if bent is None else min(*earned, bent)
    passed = least >= asked - LOSS
    words = macros("plugins.results.workshop", "words")
    found = words.off(off_m, earned, bent, softest.bend_m, asked, engine)
    mend = (
        "give what slides or is held 0.5 mm more room, and let the motion lead it there"
    )
    checks = [Check("fit", passed, found, mend)]

    bends = f"{softest.load} bends it by {1000 * softest.bend_m:.1f} mm"
    bent_tool = bend_tool(export.printed.tool, softest)
    for body, gap_m in find_gaps(export, bent_tool, softest).items():
        if gap_m < off_m:
            mend = "thicken it, or pass farther away"
            checks.append(Check("room", False, f"{bends}, into {body}", mend))

    return checks


def draw_tools(tool: Tool, off_m: float) -> list[Tool]:
    """Return the tool with all dimensions too large, with all too small, and with each at random one of both.

    Args:
        tool: as it was designed.
        off_m: by how much dimensions are off, metres.
    """
    rng = np.random.default_rng(0)
    drawn = []
    for signs in ((1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)):
        components = []
        for component in tool.components:
            size = component.shape.bounds[1] + off_m * rng.choice(signs, 3)
            shape = component.shape.resized(np.maximum(size, THINNEST_M))
            components.append(replace(component, shape=shape))

        drawn.append(replace(tool, components=tuple(components)))

    return drawn


def bend_tool(tool: Tool, row: Strength) -> Tool:
    """Return the tool turned about its mount, so that the place of a load is where the load moves it."""
    place = np.array(row.place)
    turn = np.cross(place, np.array(row.moved)) / max(float(place @ place), 1e-12)
    bent = Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(turn))
    mount, _ = tool.placed()[row.bearer]

    def turned(component: Component) -> Component:
        if component.parent != mount:
            return component
        return replace(component, pose=bent @ component.pose)

    return replace(tool, components=tuple(map(turned, tool.components)))


def find_gaps(export: Export, tool: Tool, row: Strength) -> dict[str, float]:
    """Find how near a tool is to each body that it never touches, while it bears a load, metres.

    Args:
        export: the rollouts.
        tool: straight or bent.
        row: the load.
    """
    # The weight bends it in any engine.
    first = next(iter(export.replays.values()))
    replay = export.replays.get(row.engine, first)
    during = np.abs(replay.recording.times - row.time_s) <= WINDOW_S
    taken = subset(replay.recording, np.flatnonzero(during)[::EVERY])

    robot = export.robot
    names = {component.name for component in tool.components}
    tracks = robot_tracks(robot, tool, taken)
    parts = [track for track in tracks if track.name in names]
    found = nearest(parts, body_tracks(export.scene, robot, taken), None)

    return {
        body: near.gap_m for body, near in found.items() if body not in replay.touched
    }
