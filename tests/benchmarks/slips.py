"""Do soft bodies slip through rings and bars, and is it noticed? ``python -m tests.benchmarks.slips [speeds=M_S,...]``.

In MuJoCo a ring that is the arm's tool pulls at a rope that goes through it and is pinned at both ends, and a rod that
is the tool drags a cloth over a fixed bar. Whether the soft body slipped is read from its last nodes: a rope that no
longer goes through the ring, or a cloth that is below the bar where it lay above. This shares nothing with the check
(`core.solids.soft_passages`). Its cost is the processor time of its part of a rollout.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from unittest.mock import patch

import numpy as np

from core.design import RIGID_MOUNT, Component, Tool
from core.geometry import Array, Box, Cylinder, Pose
from core.interfaces import JointTrajectory, Recording, Rollout, Task
from core.plugins import installed
from core.scene import Body, Cloth, Elastic, Rope, Scene, Soft, State, floor, table
from core.solids.penetration import findings
from core.solids.soft_cuts import Cut
from core.solids.soft_passages import find_soft_passages
from core.solids.tracks import Tracks
from core.support.cli import arguments, command
from tests.benchmarks import measuring
from tests.support.panda import ARM, PANDA, on_panda
from tests.support.playing import evaluate_batch
from tests.support.solutions import anchored

USAGE = "usage: python -m tests.benchmarks.slips [speeds=M_S,...] [youngs=PA,...]"
LONG_M = 0.2  # of the tool
RING_M = (0.02, 0.006)  # the ring's inner radius, and how thick it is
SIDES = 12  # of the ring
BAR_M = 0.006  # radius
COUNTS = (13, 5)  # of the cloth's nodes
AT = np.array([0.5, 0.0, 0.3])  # where the tool's tip starts
GREY = (0.5, 0.5, 0.5, 1.0)
RECORD_HZ = 200.0


@dataclass
class Settings:
    """``ways_m``: how far the ring is pulled; ``youngs``: of ropes, Pa; a cloth has a tenth."""

    speeds: list[float] = field(default_factory=lambda: [0.2, 0.8])
    ways_m: list[float] = field(default_factory=lambda: [0.04, 0.12])
    youngs: list[float] = field(default_factory=lambda: [1e6, 3e7])


@dataclass(frozen=True)
class Case:
    """A tool, the way (3,) of its tip, a soft body, and whether that slipped by its last nodes and the tip's place."""

    tool: Tool
    way: Array
    soft: Soft
    fixed: tuple[Body, ...]
    has_slipped: Callable[[Array, Array], bool]


class Alone(Task):
    """A scene that is only played."""

    name = "Alone"
    description = "Nothing is asked."
    goals = ()

    def __init__(self, case: Case) -> None:
        self.made = Scene((floor(), table(), *case.fixed, case.soft))

    def scene(self, seed: int) -> Scene:
        return self.made

    def reward(self, start: State, end: State, trace: object = None) -> Array:
        return np.zeros(())


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    counts = Counter[str]()
    shares = []

    for young in given.youngs:
        for speed in given.speeds:
            cases = {f"ring {way:g} m": pull_ring(way, young) for way in given.ways_m}
            for way in given.ways_m:
                for tied in (False, True):
                    name = f"{'tied' if tied else 'free'} cloth {way:g} m"
                    cases[name] = drag_cloth(way, young / 10, is_tied=tied)
            for name, case in cases.items():
                slipped, texts, share = try_case(case, speed)
                words = "slipped" if slipped else "held"
                words += _judge(slipped, bool(texts))
                counts[words] += 1
                shares.append(share)
                line = f"{name} {speed:g} m/s {young:.0e} Pa: {words}; {share:.2%}; {texts}\n"
                sys.stdout.write(line)
                sys.stdout.flush()

    for name in ("PullRope", "HangCloth", "GatherBall"):
        share = measure_share(name)
        sys.stdout.write(f"{name}'s reference: {share:.2%}\n")

    sys.stdout.write(
        f"{dict(counts)}; cost {np.mean(shares):.2%}, most {max(shares):.2%}\n"
    )


def _judge(slipped: bool, found: bool) -> str:
    if slipped:
        return ", found" if found else ", missed"
    return ", false alarm" if found else ", silent"


def pull_ring(way: float, young: float) -> Case:
    """Make a ring that is pulled sideways by the rope through it."""
    inner, thick = RING_M
    middle = inner + thick / 2
    stem = Component(
        "stem",
        RIGID_MOUNT,
        _down((LONG_M - inner) / 2),
        Box((0.01, 0.01, LONG_M - inner)),
    )
    parts = [stem]
    side = 2 * middle * np.tan(np.pi / SIDES) + thick
    for number in range(SIDES):
        angle = 2 * np.pi * number / SIDES
        at = (0.0, middle * np.sin(angle), middle * np.cos(angle) - LONG_M)
        pose = Pose.xyz_rpy(at, (-angle, 0.0, 0.0))
        shape = Box((thick, side, thick))
        parts.append(Component(f"side{number}", RIGID_MOUNT, pose, shape))

    form = Rope(((-0.15, 0.0, 0.0), (0.15, 0.0, 0.0)), 25, thickness=0.006)
    elastic = Elastic(900, young, friction=0.3)
    soft = Soft.make("soft", form, elastic, Pose(AT), color=GREY, pinned=(0, 24))

    def has_slipped(nodes: Array, tip: Array) -> bool:
        apart = nodes - tip
        x = apart[:, 0]
        crosses = np.flatnonzero((x[:-1] > 0) != (x[1:] > 0))
        share = x[crosses] / (x[crosses] - x[crosses + 1])
        there = apart[crosses] + share[:, None] * (apart[crosses + 1] - apart[crosses])
        within = np.linalg.norm(there[:, 1:], axis=1) < middle
        return int(within.sum()) % 2 == 0

    return Case(Tool(tuple(parts)), np.array([0.0, way, 0.0]), soft, (), has_slipped)


def drag_cloth(way: float, young: float, *, is_tied: bool) -> Case:
    """Make a rod that presses a cloth down between a bar and where it is pinned, and so drags the rest over the bar.

    One that ``is_tied`` is pinned on the other side of the bar too, and can't follow.
    """
    rod = Component("rod", RIGID_MOUNT, _down(LONG_M / 2), Box((0.012, 0.012, LONG_M)))
    foot = Component("foot", "rod", _down(LONG_M / 2), Box((0.012, 0.2, 0.012)))
    bar_at = AT - np.array([0.075, 0.0, 0.02])
    bar = Body.of(
        "bar",
        Cylinder(BAR_M, 0.4),
        tuple(bar_at.tolist()),
        color=GREY,
        rpy=(np.pi / 2, 0, 0),
        mass=0.0,
    )

    along, across = COUNTS
    form = Cloth((0.3, 0.12), COUNTS, thickness=0.002)
    count = along * across
    pinned = [*range(count - across, count)]
    if is_tied:
        pinned += range(across)
    soft = Soft.make(
        "soft",
        form,
        Elastic(300, young, friction=0.3),
        Pose(bar_at + np.array([0.0, 0.0, BAR_M + 0.002])),
        color=GREY,
        pinned=pinned,
    )

    def has_slipped(nodes: Array, tip: Array) -> bool:
        if _is_pierced(nodes[form.elements], tip):
            return True

        rows = nodes.reshape(along, across, 3).swapaxes(0, 1)
        for row in rows:
            x = row[:, 0] - bar_at[0]
            crosses = np.flatnonzero((x[:-1] > 0) != (x[1:] > 0))
            share = x[crosses] / (x[crosses] - x[crosses + 1])
            heights = row[crosses, 2] + share * (row[crosses + 1, 2] - row[crosses, 2])
            if (heights < bar_at[2]).any() and not (heights > bar_at[2]).any():
                return True
        return False

    down = np.array([0.0, 0.0, -way])
    return Case(Tool((rod, foot)), down, soft, (bar,), has_slipped)


def _is_pierced(triangles: Array, tip: Array) -> bool:
    """Check if an upright rod that ends at ``tip`` (3,) goes through one of triangles (F, 3, 3)."""
    corner = triangles[:, 0]
    edges = np.stack([triangles[:, 1] - corner, triangles[:, 2] - corner], axis=2)
    level = edges[:, :2]
    sound = np.abs(np.linalg.det(level)) > 1e-12
    apart = (tip[:2] - corner[sound, :2])[..., None]
    shares = np.linalg.solve(level[sound], apart)[..., 0]
    met = (shares >= 0).all(axis=1) & (shares.sum(axis=1) <= 1)
    heights = corner[sound, 2] + (edges[sound, 2] * shares).sum(axis=1) - tip[2]
    return bool((met & (heights > 0.006) & (heights < LONG_M)).any())


def _down(depth: float) -> Pose:
    return Pose(np.array([0.0, 0.0, -depth]))


def try_case(case: Case, speed: float) -> tuple[bool, list[str], float]:
    """Play a case: whether the soft body slipped, what was found, and the check's share of the processor time."""
    begun = time.process_time()
    task = on_panda(Alone(case))
    recording = _play(task, case, speed)
    with Stopwatch() as spent:
        found = findings(task.made, PANDA, case.tool, recording)
    share = spent.seconds / (time.process_time() - begun)

    tip = ARM.forward(recording.arm[-1]).apply(np.array([0.0, 0.0, -LONG_M]))
    slipped = case.has_slipped(recording.states.nodes("soft")[-1], tip)
    texts = [finding.text for finding in found if "soft" in finding.text]
    return slipped, texts, share


def measure_share(name: str) -> float:
    """Measure which share of its processor time the check takes, where a task's reference is tried."""
    task = installed().create("task", name)
    engine = installed().create("sim", "mujoco")
    solution = anchored(name)
    evaluate_batch(task, engine, [solution])
    begun = time.process_time()
    with Stopwatch() as spent:
        evaluate_batch(task, engine, [solution])
    return spent.seconds / (time.process_time() - begun)


class Stopwatch:
    """Takes the processor time of the check for soft passages, while it is open."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._patch = patch(
            "core.solids.penetration.find_soft_passages", self._find_passages
        )

    def __enter__(self) -> Stopwatch:
        self._patch.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._patch.stop()

    def _find_passages(self, scene: Scene, tracks: Tracks, states: State) -> list[Cut]:
        begun = time.process_time()
        cuts = [*find_soft_passages(scene, tracks, states)]
        self.seconds += time.process_time() - begun
        return cuts


def _play(task: Task, case: Case, speed: float) -> Recording:
    """Lead the tool's tip along the case's way, straight, at this speed."""
    seconds = float(np.linalg.norm(case.way)) / speed
    times = np.linspace(0.0, seconds, 20)
    joints = ARM.home_for(Pose(AT + np.array([0.0, 0.0, LONG_M])))
    arm = [joints]
    for share in times[1:] / seconds:
        goal = Pose(AT + share * case.way + np.array([0.0, 0.0, LONG_M]))
        arm.append(ARM.inverse(goal, arm[-1]).joints)

    trajectory = JointTrajectory(times, np.array(arm), np.zeros(len(times)))
    job = Rollout(
        case.tool, trajectory, 1, settle_s=0.3, hold_s=0.5, record_hz=RECORD_HZ
    )
    (outcome,) = installed().create("sim", "mujoco").rollout(task, [job])
    if outcome.recording is None:
        raise RuntimeError(outcome.error)
    return outcome.recording


if __name__ == "__main__":
    command(lambda _: main())
