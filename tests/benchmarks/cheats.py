"""Which rewards can be had without the work? ``python -m tests.benchmarks.cheats folder=cheats``.

For every task and every measure of absurdity (`tests.benchmarks.absurd`), an evolution varies documents as a model
writes them: ``tool=solids`` with joints, springs and dampers, and anchored plans with tempo. It starts from the
reference solution and from random designs, and looks for a high reward of a rollout that is wholly absurd. What earns
0.3 or more is a finding, kept in ``findings/``, a designs file. What the folder has is not searched again; another seed
adds. A task may also be a scene file with a designs file beside it; where it has a place for a fixture, that is drawn
and varied too.

`vlmgineer evaluate` plays a finding once more in any engine, with a film.
"""

from __future__ import annotations

import sys
import time
import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from rich.console import Console
from scipy.spatial.transform import Rotation

from core.config.compose import engines, load, part
from core.design import (
    RIGID_MOUNT,
    Candidate,
    Component,
    DesignError,
    Fixture,
    Tool,
    ToolJoint,
    Waypoints,
)
from core.designs.reading import dump_design, load_designs, read_designs
from core.designs.springs import measure_lightness
from core.errors import choices
from core.geometry import Box, Cylinder, Mesh, Pose, Shape, Sphere
from core.interfaces import Numbers, Simulator, Task
from core.plugins import PluginPart, installed
from core.scene import Region
from core.support.cli import arguments, command
from core.trial import Evaluation
from plugins.actions.anchored import AnchoredPlan, Step
from plugins.strategies.refined.moves import move
from plugins.tools.joint_rules import (
    LIMITS,
    MAX_DECAY,
    MAX_HZ,
    MAX_SPRINGS_J,
)
from plugins.tools.varying import tool_numbers, vary_tool
from tests.benchmarks import measuring
from tests.benchmarks.absurd import EVERYWHERE, MEASURES, Watched, tried
from tests.support.playing import evaluate_batch
from tests.support.solutions import FILES, anchored, representation

USAGE = (
    "usage: python -m tests.benchmarks.cheats [folder=DIR] [tasks=NAME,...] [measures=NAME,...] [sim=NAME] "
    "[rollouts=N] [seed=N] [workers=N]"
)
FOUND = 0.3
PARENTS = 10
CHILDREN = 12
FIRST = 24
# Of rollouts, by their cost.
SHARES = {"HangRing": 0.5, "StopCart": 0.5, "SweepCards": 0.25, "PourGrains": 0.05}
SHARES |= {
    "GatherSpheres": 0.05,
    "TurkeyLegs": 0.15,
    "CleanTable": 0.5,
    "ElevatePlate": 0.5,
}
TETRAHEDRON = np.vstack([np.zeros(3), np.eye(3)]) - 0.25

HARD = sorted(
    name for name, file in FILES.items() if file.parent.name == "hardtoolbench"
)

console = Console(stderr=True)


@dataclass
class Settings:
    """``rollouts`` are for all tasks and measures together."""

    folder: str = "cheats"
    tasks: list[str] = field(default_factory=lambda: HARD)
    measures: list[str] = field(default_factory=lambda: [*EVERYWHERE])
    sim: str = "mujoco"
    rollouts: int = 100_000
    seed: int = 0
    workers: int | None = None


@dataclass(frozen=True)
class Pair:
    """A search: one task, one measure."""

    task: str
    measure: str
    sim: PluginPart[Simulator]
    seed: int
    rollouts: int
    folder: Path

    @property
    def file(self) -> Path:
        name = Path(self.task).stem
        return self.folder / "searched" / f"{name}.{self.measure}.{self.seed}.json"


def main() -> None:
    given = measuring.settings(arguments(USAGE, sys.argv[1:]), Settings)
    for measure in given.measures:
        if measure not in MEASURES:
            raise choices("measure", measure, list(MEASURES))
    search(given)


def make_task(name: str) -> Task:
    """Make a task by its name, or of its scene file."""
    if not name.endswith(".yaml"):
        return installed().create("task", name)
    made: Task = installed().create("task", "file", {"file": name})
    return made


def read_first(name: str, task: Task) -> Candidate:
    """Read the design from which the search for a task starts, with an anchored plan."""
    if not name.endswith(".yaml"):
        return anchored(name)

    file = Path(name).with_suffix(".json")
    (first, *_) = read_designs(load_designs(file), representation(file), task)
    if not isinstance(first.plan, Waypoints):
        return first

    steps = tuple(
        Step(tuple(pose[:3].tolist()), tuple(pose[3:6].tolist()))
        for pose in first.plan.poses
    )
    return replace(first, plan=AnchoredPlan(steps))


# --- what is varied ---------------------------------------------------------------------------------------------


class Varied:
    """Draws and changes designs for a task at random; ``region`` is where a fixture may stand, if there can be one."""

    def __init__(
        self,
        names: list[str],
        random: np.random.Generator,
        region: Region | None = None,
    ) -> None:
        self.names = names
        self.random = random
        self.region = region

    def draw(self) -> Candidate:
        """Draw a chain of one to four parts of any shape, and a plan around a few bodies."""
        length = self.random.uniform(0.05, 0.3)
        post = Component(
            "post",
            RIGID_MOUNT,
            Pose.xyz_rpy((0, 0, -length / 2)),
            Box((0.02, 0.02, length)),
        )
        tool = Tool((post,))
        for _ in range(int(self.random.integers(1, 4))):
            tool = self.grown(tool)
        if self.region is not None and self.random.random() < 0.7:
            tool = replace(tool, fixture=self.fixture(self.region))
        steps = tuple(self.step() for _ in range(int(self.random.integers(1, 6))))
        return Candidate(tool, AnchoredPlan(steps))

    def changed(self, candidate: Candidate, other: Candidate) -> Candidate:
        """Change a design in one to three places; one time in five it gets another's plan first."""
        tool = candidate.tool
        plan = candidate.plan
        assert tool is not None
        assert isinstance(plan, AnchoredPlan)
        if (
            self.random.random() < 0.2
            and isinstance(other.plan, AnchoredPlan)
            and not tool.gripper
        ):
            plan = replace(
                other.plan,
                gripper=False,
                steps=tuple(replace(step, grip=0.0) for step in other.plan.steps),
            )
        for _ in range(int(self.random.integers(1, 4))):
            if self.region is not None and self.random.random() < 0.3:
                tool = replace(tool, fixture=self.changed_fixture(tool, self.region))
                continue
            kind = self.random.random()
            if kind < 0.35:
                plan = self.plan(plan)
            elif kind < 0.6:
                tool = self.resized(tool)
            elif kind < 0.85:
                tool = self.joined(tool)
            elif kind < 0.93 or len(tool.components) < 3:
                tool = self.grown(tool)
            else:
                parents = {component.parent for component in tool.components}
                leaves = [
                    component
                    for component in tool.components
                    if component.name not in parents
                ]
                gone = leaves[int(self.random.integers(len(leaves)))]
                tool = replace(
                    tool, components=tuple(c for c in tool.components if c is not gone)
                )
        return replace(candidate, tool=tool, plan=plan, problem=None)

    def fixture(self, region: Region) -> Fixture:
        """Draw a fixture of one to four parts, which stands on the lowest face of where it may stand."""
        low, high = np.array(region.low), np.array(region.high)
        sides = np.exp(self.random.uniform(np.log(0.004), np.log(0.3), 3))
        sides = np.minimum(sides, high - low)
        middle = self.random.uniform(low + sides / 2, high - sides / 2)
        pose = Pose(np.array([middle[0], middle[1], low[2]]))
        size = tuple(map(float, sides))
        foot = Component(
            "foot", RIGID_MOUNT, Pose(np.array([0.0, 0.0, size[2] / 2])), Box(size)
        )
        parts = Tool((foot,))
        for _ in range(int(self.random.integers(0, 4))):
            parts = self.grown(parts)
        return Fixture(parts, pose)

    def changed_fixture(self, tool: Tool, region: Region) -> Fixture | None:
        """Draw a fixture, take it away, or resize it or add to it."""
        kind = self.random.random()
        if tool.fixture is None or kind < 0.2:
            return self.fixture(region)
        if kind < 0.3:
            return None
        change = self.grown if kind < 0.5 else self.resized
        return replace(tool.fixture, parts=change(tool.fixture.parts))

    def grown(self, tool: Tool) -> Tool:
        """Add a part of any shape at a random place of the surface of another's bounding box."""
        random = self.random
        parent = tool.components[int(self.random.integers(len(tool.components)))]
        size = np.exp(random.uniform(np.log(0.004), np.log(0.3), 3))
        shapes: list[Shape] = [
            Box(tuple(size)),
            Sphere(float(size[0] / 4 + 0.002)),
            Cylinder(float(size[0] / 4 + 0.002), float(size[1])),
            Mesh.from_trimesh(trimesh.convex.convex_hull(TETRAHEDRON * (size + 0.01))),
        ]
        shape = shapes[int(random.integers(len(shapes)))]
        middle, sides = parent.shape.bounds
        at = middle + random.choice([-1, 0, 1], 3) * sides / 2
        turn = Rotation.from_rotvec(random.normal(0, 0.5, 3) * (random.random() < 0.5))
        own_middle, own_sides = shape.bounds
        held = own_middle + random.choice([-0.9, 0, 0.9], 3) * own_sides / 2
        numbers = [
            int(c.name[4:]) for c in tool.components if c.name.startswith("more")
        ]
        name = f"more{max(numbers, default=-1) + 1}"
        added = Component(
            name, parent.name, Pose.from_rotation(at - turn.apply(held), turn), shape
        )
        return replace(tool, components=(*tool.components, added))

    def resized(self, tool: Tool) -> Tool:
        numbers = tool_numbers(
            replace(
                tool,
                components=tuple(
                    replace(component, joint=None) for component in tool.components
                ),
            )
        )
        return vary_tool(tool, self.moved(numbers))

    def joined(self, tool: Tool) -> Tool:
        """Give a part a joint, change the one that it has, or take it away."""
        random = self.random
        parts = list(tool.components)
        number = int(random.integers(len(parts)))
        component = parts[number]
        if component.joint is not None and random.random() < 0.5:
            parts[number] = replace(component, joint=None)
            return replace(tool, components=tuple(parts))
        hinge = bool(random.random() < 0.6)
        upper = float(
            random.uniform(0.05, 3.0)
            if hinge
            else np.exp(random.uniform(np.log(0.003), np.log(0.2)))
        )
        axis = tuple(
            map(float, np.eye(3)[int(random.integers(3))] + random.normal(0, 0.1, 3))
        )
        middle, sides = component.shape.bounds
        origin = (
            tuple(map(float, middle + random.choice([-1, 0, 1], 3) * sides / 2))
            if hinge
            else (0.0, 0.0, 0.0)
        )
        lower, rest = (-upper, -upper) if random.random() < 0.5 else (0.0, upper)
        upper = 0.0 if lower < 0 else upper
        kind = "hinge" if hinge else "slider"
        joint = ToolJoint(kind, axis, lower, upper, origin)  # type: ignore[arg-type]
        parts[number] = replace(component, joint=joint)
        tool = replace(tool, components=tuple(parts))
        bearer = next(
            bearer for bearer in tool.bearers if bearer.name == component.name
        )
        inertia = 1 / measure_lightness(tool)[tool.bearers.index(bearer)]
        reach = max(-lower, upper)
        strong = min(
            LIMITS[kind].spring / reach,
            MAX_SPRINGS_J / reach**2,
            inertia * (2 * np.pi * MAX_HZ) ** 2,
        )
        slow = min(LIMITS[kind].damping, inertia * MAX_DECAY)
        stiffness, damping = (
            float(most * random.uniform(0.1, 0.99) * (random.random() < share))
            for most, share in ((strong, 0.8), (slow, 0.4))
        )
        friction = float(random.choice([0.0, 0.0, 0.1 * LIMITS[kind].spring]))
        joint = replace(
            joint, stiffness=stiffness, rest=rest, damping=damping, friction=friction
        )
        parts[number] = replace(component, joint=joint)
        return replace(tool, components=tuple(parts))

    def plan(self, plan: AnchoredPlan) -> AnchoredPlan:
        """Move waypoints, add or remove one, anchor one anew, or change its tempo."""
        random = self.random
        steps = list(plan.steps)
        number = int(random.integers(len(steps)))
        kind = random.random()
        if kind < 0.6:
            actions = installed().create("action", "anchored")
            moved: AnchoredPlan = actions.with_parameters(
                plan, self.moved(actions.parameters(plan))
            )
            return moved
        if kind < 0.7 and len(steps) < 20:
            steps.insert(number, self.step())
        elif kind < 0.8 and len(steps) > 1:
            del steps[number]
        elif kind < 0.9:
            steps[number] = replace(steps[number], **self.tempo())
        else:
            anchor = str(random.choice(self.names))
            steps[number] = replace(
                steps[number],
                anchor=anchor,
                toward="",
                share=0.0,
                axes=random.choice(["world", "anchor"]),
            )
        return replace(plan, steps=tuple(steps))

    def step(self) -> Step:
        random = self.random
        anchor, toward = (str(name) for name in random.choice(self.names, 2))
        between = toward != anchor and random.random() < 0.2
        offset = random.normal((0.0, 0.0, 0.2), 0.12)
        return Step(
            tuple(map(float, offset)),
            tuple(map(float, random.normal(0, 0.4, 3))),
            anchor,
            toward=toward if between else "",
            share=float(random.random()) if between else 0.0,
            **self.tempo(),
        )

    def tempo(self) -> dict[str, Any]:
        random = self.random
        pace = float(np.exp(self.random.uniform(np.log(0.02), np.log(2.0))))
        through = bool(random.random() < 0.3)
        return {
            "speed": pace if (timed := random.random()) < 0.4 else 0.0,
            "seconds": pace if timed > 0.8 else 0.0,
            "through": through,
            "wait": 0.0 if through else float(random.choice([0.0, 0.5, 2.0])),
        }

    def moved(self, numbers: Numbers) -> Any:
        return move(numbers, numbers.values, np.empty((0, len(numbers))), self.random)


# --- the search -------------------------------------------------------------------------------------------------


def search(given: Settings) -> None:
    """Search all pairs that the folder does not have."""
    sim = engines([given.sim])[given.sim]
    folder = Path(given.folder)
    shares = {task: SHARES.get(task, 1.0) for task in given.tasks}
    each = given.rollouts / len(given.measures) / sum(shares.values())
    counts = {task: int(np.ceil(each * share)) for task, share in shares.items()}
    pairs = [
        Pair(task, m, sim, given.seed, counts[task], folder)
        for m in given.measures
        for task in given.tasks
    ]
    search_all(pairs, measuring.workers(given.workers))


def search_all(pairs: Sequence[Pair], workers: int) -> None:
    """Search the pairs that their folder does not have, and print each summary."""
    words = [f"executor.workers={workers}", "executor.timeout_s=null"]
    with part("executor", load("evaluate", words).executor).create() as executor:
        for pair, result in executor.map(
            searched, [pair for pair in pairs if not pair.file.exists()]
        ):
            if isinstance(result, Exception):
                raise result
            console.print(
                f"{pair.task} {pair.measure}: {result}", highlight=False, soft_wrap=True
            )


def searched(pair: Pair) -> str:
    """Search for one pair, write its files, and return a summary."""
    began = time.perf_counter()
    run = _Search(pair)
    best = run.run()
    absurd = [evaluation for evaluation, lack in best if lack == 0]
    top = max((evaluation.reward for evaluation in absurd), default=0.0)
    record = {
        "rollouts": run.rollouts,
        "statuses": dict(run.statuses),
        "best": top,
        "absurd": run.absurd,
    }
    record["seconds"] = round(time.perf_counter() - began, 1)
    found = [dump_design(e.candidate, run.tools) for e in absurd if e.reward >= FOUND]
    if found:
        (pair.folder / "findings").mkdir(parents=True, exist_ok=True)
        document = {"task": pair.task, "seed": pair.seed, "strategies": found}
        measuring.save(pair.folder / "findings" / pair.file.name, document)
    pair.file.parent.mkdir(parents=True, exist_ok=True)
    measuring.save(pair.file, record)
    return f"{top:.3f} in {run.rollouts} rollouts, {run.absurd} absurd, {record['seconds']} s"


class _Search:
    def __init__(self, pair: Pair) -> None:
        self.pair = pair
        self.measure = MEASURES[pair.measure]
        self.task = make_task(pair.task)
        self.simulator = Watched(pair.sim.create())
        self.tools = installed().create("tool", "solids", {"joints": True})
        self.actions = installed().create("action", "anchored")
        self.scene = self.task.scene(pair.seed)
        self.random = np.random.default_rng(zlib.crc32(pair.file.name.encode()))
        names = ["world", *(body.name for body in self.scene.bodies)]
        self.varied = Varied(names, self.random, self.task.fixture)
        self.rollouts = 0
        self.absurd = 0
        self.statuses = Counter[str]()

    def run(self) -> list[tuple[Evaluation, float]]:
        """Return the best designs and what they lack, after the pair's rollouts: first what is absurd and earns."""
        first = read_first(self.pair.task, self.task)
        drawn = [self.sound(self.varied.draw) for _ in range(FIRST)]
        ranked = self.tried(
            [
                first,
                *(
                    self.sound(lambda: self.varied.changed(first, first))
                    for _ in range(FIRST)
                ),
                *drawn,
            ]
        )
        asked = 0
        while self.rollouts < self.pair.rollouts and asked < 4 * self.pair.rollouts:
            children = []
            for _ in range(CHILDREN):
                one, other = (
                    ranked[int(self.random.integers(len(ranked)))][0].candidate
                    for _ in range(2)
                )
                children.append(
                    self.sound(
                        lambda one=one, other=other: self.varied.changed(one, other)
                    )
                )  # type: ignore[misc]
            children.append(self.sound(self.varied.draw))
            asked += len(children)
            ranked = self.kept(ranked + self.tried(children))
        return ranked

    def kept(
        self, evaluated: list[tuple[Evaluation, float]]
    ) -> list[tuple[Evaluation, float]]:
        return sorted(evaluated, key=lambda pair: pair[1] - pair[0].reward)[:PARENTS]

    def sound(self, make: Callable[[], Candidate]) -> Candidate:
        """Make designs until one keeps the rules, twenty at most; as a model's they are written and read."""
        for _ in range(20):
            try:
                candidate = make()
                if self.pair.measure == "still":
                    home = self.task.home
                    step = Step(
                        tuple(map(float, home.position)),
                        tuple(map(float, home.rpy)),
                        wait=2.0,
                    )
                    candidate = replace(
                        candidate, plan=AnchoredPlan((step,), candidate.tool.gripper)
                    )  # type: ignore[union-attr]
                (read,) = self.read([dump_design(candidate, self.tools)])
            except DesignError as error:
                read = Candidate(None, AnchoredPlan(()), problem=str(error))
            if read.problem is None:
                break
            self.statuses["refused"] += 1
        return read

    def read(self, strategies: list[Any]) -> list[Candidate]:
        return read_designs(
            {"strategies": strategies}, self.tools, self.task, actions=self.actions
        )

    def tried(self, candidates: list[Candidate]) -> list[tuple[Evaluation, float]]:
        """Play candidates; those that could be played, with what each lacks to be absurd."""
        sound = [candidate for candidate in candidates if candidate.problem is None]
        evaluations = evaluate_batch(self.task, self.simulator, sound, self.pair.seed)
        jobs = zip(self.simulator.jobs, self.simulator.outcomes, strict=True)
        played = {id(job.tool): (job, outcome.recording) for job, outcome in jobs}
        ranked = []
        for evaluation in evaluations:
            self.statuses[evaluation.status] += 1
            job, recording = played.get(id(evaluation.candidate.tool), (None, None))
            self.rollouts += job is not None
            if job is None or recording is None or evaluation.status != "ok":
                continue
            scene = self.scene.furnished(job.tool)
            lack = self.measure(tried(scene, evaluation, job, recording))
            self.absurd += int(lack == 0)
            ranked.append((evaluation, lack))
        self.simulator.jobs = ()
        self.simulator.outcomes = []
        return ranked


if __name__ == "__main__":
    command(lambda _: main())
