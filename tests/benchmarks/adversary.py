"""Do absurd tools earn rewards? ``python -m tests.benchmarks.adversary search folder=attacks rollouts=100000``.

For every task and every objective of `tests.benchmarks.absurd`, CMA-ES varies geometry and plan together and looks for
a high reward of a tool that is absurd by construction. It starts from the reference solution and from the embedded
designer's best, each with a box shrunk, and from random chains of boxes. What earns 0.3 or more is a finding, kept in
``findings/TASK.OBJECTIVE.SEED.json``, a designs file. What the folder has is not searched again; another seed adds.

``judge`` plays every finding once more in all of ``sims`` and 200 times a second, and draws a film strip. ``honest``
counts the penetrations that are found in reference solutions and in ``count`` designs of the embedded designer.
"""

from __future__ import annotations

import json
import sys
import time
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cmaes
import numpy as np
from rich.console import Console

from core.config.compose import engines, load, part
from core.design import Candidate, DesignError, Evaluation, best_first
from core.designs.reading import dump_design, load_designs, read_designs
from core.designs.rules import SpawnRules, check_plan, check_tool
from core.errors import UsageError, choices
from core.geometry import Array
from core.interfaces import Image, Recording, RolloutSettings, Simulator, Task
from core.plugins import installed
from core.search.evolution import evaluate_all
from core.simulation.pictures import png
from core.simulation.rollout import Evaluator, PluginPart, evaluate_batch, prepare
from core.solids.penetration import Explosion, findings
from core.support.cli import command
from tests.benchmarks import measuring
from tests.benchmarks.absurd import OBJECTIVES, Start, Watched, hanging, random_start, tried

USAGE = (
    "usage: python -m tests.benchmarks.adversary search|table|judge|honest [folder=DIR] [tasks=NAME,...] "
    "[objectives=NAME,...] [sims=NAME,...] [rollouts=N] [count=N] [seed=N] [workers=N]"
)
FOUND = 0.3
SHARES = {"GatherSpheres": 0.05, "TurkeyLegs": 0.15, "CleanTable": 0.5, "ElevatePlate": 0.5}  # of rollouts, by cost
DENSE_HZ, FRAMES = 200.0, 8
PENETRATIONS = ("passed through", "deep inside", "cut into")
POOL, SIGMA, SHRUNK = 24, 0.5, -3.0  # random starts to choose from; the first spread; a shrunk box's numbers

console = Console(stderr=True)


@dataclass
class Settings:
    """``sims``: the first one is searched in. ``rollouts`` and ``count`` are for all tasks together."""

    folder: str = "attacks"
    tasks: list[str] = field(default_factory=list)
    objectives: list[str] = field(default_factory=lambda: list(OBJECTIVES))
    sims: list[str] = field(default_factory=lambda: ["mujoco", "pybullet", "sapien"])
    rollouts: int = 100_000
    count: int = 1000
    seed: int = 0
    workers: int | None = None


@dataclass(frozen=True)
class Pair:
    """A search: one task, one objective or measure."""

    task: str
    objective: str
    sim: PluginPart[Simulator]
    seed: int
    rollouts: int
    folder: Path

    @property
    def file(self) -> Path:
        return self.folder / "searched" / f"{self.task}.{self.objective}.{self.seed}.json"

    @property
    def designs(self) -> Path:
        return self.folder / f"seed_{self.seed}"


def main() -> None:
    commands = {"search": search, "table": table, "judge": judge, "honest": honest}
    match sys.argv[1:]:
        case ["--help" | "-h"]:
            sys.stdout.write(f"{USAGE}\n")
        case [name, *words] if name in commands:
            given = measuring.settings(words, Settings)
            for objective in given.objectives:
                if objective not in OBJECTIVES:
                    raise choices("objective", objective, list(OBJECTIVES))
            commands[name](given)
        case _:
            raise UsageError(USAGE)


# --- the search -------------------------------------------------------------------------------------------------


def search(given: Settings) -> None:
    """Search all pairs that the folder does not have, and print the table."""
    names, folder, sim = measuring.tasks(given.tasks), Path(given.folder), engines(given.sims[:1])[given.sims[0]]
    workers, whole = measuring.workers(given.workers), sum(SHARES.get(name, 1.0) for name in names)
    for name in names:
        measuring.designs(name, 12, sim.name, given.seed, workers, folder / f"seed_{given.seed}")
    pairs = []
    for objective in given.objectives:
        for name in names:
            count = round(given.rollouts * SHARES.get(name, 1.0) / whole / len(given.objectives))
            pairs.append(Pair(name, objective, sim, given.seed, count, folder))
    search_all(pairs, searched, workers)
    table(given)


def search_all(pairs: Sequence[Pair], searched: Callable[[Pair], str], workers: int) -> None:
    """Search the pairs that their folder does not have, and print each summary."""
    words = [f"executor.workers={workers}", "executor.timeout_s=null"]
    with part("executor", load("evaluate", words).executor).create() as executor:
        for pair, result in executor.map(searched, [pair for pair in pairs if not pair.file.exists()]):
            if isinstance(result, Exception):
                raise result
            console.print(f"{pair.task} {pair.objective}: {result}", highlight=False, soft_wrap=True)


def searched(pair: Pair) -> str:
    """Search for one pair, write its files, and return a summary."""
    run, began = _Search(pair), time.perf_counter()
    kept = [best for best in (run.climbed(*start) for start in run.starts()) if best is not None]
    kept.sort(key=lambda item: -item[1].reward)
    representation = installed().create("tool", "urdf")
    strategies = []
    for origin, evaluation in kept:
        if evaluation.reward >= FOUND:
            texts = {"strategy_name": f"{pair.objective} from {origin}"}
            texts["strategy_description"] = (
                f"{OBJECTIVES[pair.objective].says}; {evaluation.reward:.3f} in {pair.sim.name}"
            )
            strategies.append(dump_design(evaluation.candidate, representation) | texts)
    record = {
        "rollouts": run.rollouts,
        "statuses": dict(run.statuses),
        "seconds": round(time.perf_counter() - began, 1),
        "best": kept[0][1].reward if kept else 0.0,
        "from": kept[0][0] if kept else "",
    }
    pair.file.parent.mkdir(parents=True, exist_ok=True)
    if strategies:
        file = pair.folder / "findings" / pair.file.name
        file.parent.mkdir(parents=True, exist_ok=True)
        measuring.save(file, {"task": pair.task, "seed": pair.seed, "strategies": strategies})
    measuring.save(pair.file, record)
    return f"{record['best']:.3f} in {run.rollouts} rollouts, {record['seconds']} s"


class _Search:
    """Tries candidates of one pair, and counts them."""

    def __init__(self, pair: Pair) -> None:
        self.pair, self.objective = pair, OBJECTIVES[pair.objective]
        self.task: Task = installed().create("task", pair.task)
        self.simulator = Watched(pair.sim.create())
        self.spawn, self.scene = SpawnRules(self.task, pair.seed), self.task.scene(pair.seed)
        self.number = zlib.crc32(f"{pair.seed} {pair.task} {pair.objective}".encode())
        self.random = np.random.default_rng(self.number)
        self.rollouts, self.statuses = 0, Counter[str]()

    def starts(self) -> Iterator[tuple[str, Start, Array, int]]:
        """Yield each start with its name, the first mean, and its number of rollouts."""
        each = self.pair.rollouts // 6
        files = {"the solution": measuring.SOLUTIONS / f"{self.pair.task}.json"}
        files["a design"] = self.pair.designs / "designs" / f"{self.pair.task}.json"
        for name, file in files.items():
            if not file.exists():  # HardToolBench's solutions look at the scene
                continue
            read = read_designs(load_designs(file), installed().create("tool", "urdf"), self.spawn)
            read = [candidate for candidate in read if candidate.problem is None]
            self.rollouts += len(read)
            evaluator = Evaluator(PluginPart("task", self.pair.task), self.pair.sim, self.pair.seed)
            for evaluation in best_first(evaluator(read))[: 2 if name == "a design" else 1]:
                plan = evaluation.candidate.plan.poses
                start = Start(evaluation.candidate.tool, plan)  # type: ignore[arg-type]
                yield name, start, self.mean(start), each
        for left in (3, 2, 1):
            pool = [random_start(self.task, self.pair.seed, self.random, flat=self.objective.flat) for _ in range(POOL)]
            bent = [start.bent(np.zeros(start.size), self.objective.shape) for start in pool]
            best = int(np.argmin([cost for cost, _ in self.costs(bent)]))
            yield "a random start", pool[best], np.zeros(pool[best].size), (self.pair.rollouts - self.rollouts) // left

    def mean(self, start: Start) -> Array:
        """Return the first mean: one box is shrunk."""
        mean, chosen = np.zeros(start.size), int(self.random.integers(len(start.tool.components)))
        mean[9 * chosen : 9 * chosen + 3] = SHRUNK
        return mean

    def climbed(self, name: str, start: Start, mean: Array, rollouts: int) -> tuple[str, Evaluation] | None:
        """Run CMA-ES from a start, again from its best where it stops; the best absurd rollout, if there is one."""
        best: Evaluation | None = None
        end, tries, asked = self.rollouts + rollouts, 0, 0
        while self.rollouts < end and asked < 4 * rollouts:
            tries += 1
            optimizer = cmaes.SepCMA(mean, SIGMA / tries, seed=self.number % 2**31 + tries)
            while not optimizer.should_stop() and self.rollouts < end and asked < 4 * rollouts:
                asks = [optimizer.ask() for _ in range(optimizer.population_size)]
                asked += len(asks)
                costs = self.costs([start.bent(numbers, self.objective.shape) for numbers in asks])
                tells = []
                for numbers, (cost, evaluation) in zip(asks, costs, strict=True):
                    away = float(numbers @ numbers) / len(numbers) if evaluation is None else 0.0
                    tells.append((numbers, cost + 0.01 * away))
                    absurd = evaluation is not None and cost == -evaluation.reward
                    if absurd and evaluation.reward > (best.reward if best else 0.0):
                        best, mean = evaluation, numbers
                optimizer.tell(tells)
        return None if best is None else (name, best)

    def costs(self, candidates: list[Candidate]) -> list[tuple[float, Evaluation | None]]:
        """Each candidate's cost, which is the negative reward if the rollout is absurd, and its evaluation."""
        checked = [self.checked(candidate) for candidate in candidates]
        evaluations = evaluate_batch(self.task, self.simulator, checked, self.pair.seed, RolloutSettings())
        jobs = zip(self.simulator.jobs, self.simulator.outcomes, strict=True)
        played = {id(job.tool): (job, outcome.recording) for job, outcome in jobs}
        costs: list[tuple[float, Evaluation | None]] = []
        for evaluation in evaluations:
            self.statuses[evaluation.status] += 1
            job, recording = played.get(id(evaluation.candidate.tool), (None, None))
            if job is None or evaluation.status == "rejected":
                costs.append((2.0, None))
                continue
            self.rollouts += 1
            if evaluation.status != "ok" or recording is None:
                costs.append((1.5, None))
                continue
            lack = self.objective.lack(tried(self.scene, evaluation, job, recording))
            costs.append((lack - evaluation.reward, evaluation))
        self.simulator.jobs, self.simulator.outcomes = (), []
        return costs

    def checked(self, candidate: Candidate) -> Candidate:
        assert candidate.tool is not None
        problem = None
        try:
            check_tool(candidate.tool, self.task.robot)
            check_plan(candidate.plan.poses, gripper=candidate.tool.gripper)
            self.spawn.check(candidate.tool)
        except DesignError as error:
            problem = str(error)
        return Candidate(candidate.tool, candidate.plan.poses, problem=problem)


def table(given: Settings) -> None:
    """Print rollouts, and the best reward of an absurd rollout by task and objective, also to ``table.md``."""
    folder = Path(given.folder)
    lines = [f"| task | rollouts | {' | '.join(given.objectives)} |", "|---" * (2 + len(given.objectives)) + "|"]
    rollouts, seconds = 0, 0.0
    for name in measuring.tasks(given.tasks):
        count, cells = 0, []
        for objective in given.objectives:
            files = (folder / "searched").glob(f"{name}.{objective}.*.json")
            records = [json.loads(file.read_text()) for file in files]
            count += sum(record["rollouts"] for record in records)
            seconds += sum(record["seconds"] for record in records)
            cells.append(f"{max(record['best'] for record in records):.2f}" if records else "–")
        rollouts += count
        lines.append(f"| {name} | {count:,} | {' | '.join(cells)} |")
    lines.append(
        f"\n{rollouts:,} rollouts in {seconds / 3600:.2f} hours of a core, {rollouts / max(seconds, 1):.1f} a second."
    )
    (folder / "table.md").write_text("\n".join(lines) + "\n")
    sys.stdout.write("\n".join(lines) + "\n")


# --- the judge --------------------------------------------------------------------------------------------------


def judge(given: Settings) -> None:
    """Play each finding in every engine and densely sampled, draw it, and print the most doubtful first."""
    folder, sims = Path(given.folder), engines(given.sims)
    rows = []
    for file in sorted((folder / "findings").glob("*.json")):
        name, objective, seed = file.stem.split(".")
        if name not in measuring.tasks(given.tasks) or objective not in given.objectives:
            continue
        task: Task = installed().create("task", name)
        read = read_designs(load_designs(file), installed().create("tool", "urdf"), SpawnRules(task, int(seed)))
        for number, candidate in enumerate(read[:2]):
            rewards, warnings = [], Counter[str]()
            for sim in sims.values():
                (evaluation,) = Evaluator(PluginPart("task", name), sim, int(seed))([candidate])
                rewards.append(evaluation.reward)
                warnings.update([evaluation.reason or ", ".join(evaluation.warnings)])
            simulator = next(iter(sims.values())).create()
            recording, found = dense(task, simulator, candidate, int(seed))
            air = hanging(task.scene(int(seed)), candidate.tool, recording) if recording else (0.0, "")
            strip = folder / "strips" / f"{file.stem}.{number}.png"
            strip.parent.mkdir(exist_ok=True)
            strip.write_bytes(png(film_strip(task, simulator, candidate, int(seed))))
            doubt = (rewards[0] - min(rewards)) + bool(found) + min(air[0] / 0.02, 1.0)
            rows.append({"finding": strip.stem, "rewards": rewards, "dense": found, "air": air, "doubt": doubt})
    rows.sort(key=lambda row: -row["doubt"])
    measuring.save(folder / "judged.json", rows)
    sys.stdout.write(f"| finding | {' | '.join(sims)} | at {DENSE_HZ:g} Hz | hangs by, m | doubt |\n")
    sys.stdout.write("|---" * (4 + len(sims)) + "|\n")
    for row in rows:
        rewards = " | ".join(f"{reward:.2f}" for reward in row["rewards"])
        hangs = f"{row['air'][0]:.3f} {row['air'][1]}"
        sys.stdout.write(
            f"| {row['finding']} | {rewards} | {'; '.join(row['dense'])} | {hangs} | {row['doubt']:.2f} |\n"
        )


def dense(task: Task, simulator: Simulator, candidate: Candidate, seed: int) -> tuple[Recording | None, list[str]]:
    """Play a candidate with dense samples, and look for penetrations in them."""
    assert candidate.tool is not None
    _, job = prepare(task, candidate, seed, RolloutSettings(), DENSE_HZ)
    recording = simulator.rollout(task, [job])[0].recording
    if recording is None:
        return None, ["no recording"]
    try:
        found = findings(task.scene(seed), task.robot, candidate.tool, recording)
    except Explosion as error:
        return recording, [str(error)]
    return recording, [finding.text for finding in found]


def film_strip(task: Task, simulator: Simulator, candidate: Candidate, seed: int) -> Image:
    """Draw `FRAMES` instants of a rollout in two rows."""
    _, job = prepare(task, candidate, seed, RolloutSettings(), 50.0)
    recording = simulator.rollout(task, [job])[0].recording
    assert recording is not None
    moving = np.flatnonzero(recording.times <= job.trajectory.duration + 0.2)
    frames = []
    for k in [
        *np.linspace(moving[len(moving) // 10], moving[-1], FRAMES - 1).round().astype(int),
        len(recording.times) - 1,
    ]:
        look = {"arm": recording.arm[k], "fingers": recording.fingers[k], "state": recording.states[k]}
        frames.append(simulator.render(task, seed=seed, tool=candidate.tool, width=480, height=360, **look))
    return np.vstack([np.hstack(frames[: FRAMES // 2]), np.hstack(frames[FRAMES // 2 :])])


# --- honest designs ---------------------------------------------------------------------------------------------


def honest(given: Settings) -> None:
    """Print how many honest designs have a penetration, by task and engine, and name them."""
    names, sims, folder = measuring.tasks(given.tasks), engines(given.sims), Path(given.folder) / "honest"
    workers, each = measuring.workers(given.workers), -(-given.count // len(names))
    lines, flagged = ["| task | engine | solutions | designs | earn 0.5 or more | penetrations |", "|---" * 6 + "|"], []
    with measuring.executor(workers) as executor:
        for shown, sim in sims.items():
            for name in names:
                file = folder / f"{name}.{shown}.json"
                if not file.exists():
                    designs = measuring.designs(name, each, "mujoco", given.seed, workers, folder)
                    spawn = SpawnRules(installed().create("task", name), given.seed)
                    solution = load_designs(measuring.SOLUTIONS / f"{name}.json")
                    solved = read_designs(solution, installed().create("tool", "urdf"), spawn, agent=-1)
                    settings = RolloutSettings(penetration="warn")
                    evaluator = Evaluator(PluginPart("task", name), sim, given.seed, settings)
                    played = list(evaluate_all([*solved, *designs.candidates], evaluator, executor))
                    record = [
                        {
                            "id": e.candidate.id,
                            "solution": e.candidate.agent < 0,
                            "reward": e.reward,
                            "warnings": e.warnings,
                        }
                        for e in sorted(played, key=lambda e: e.candidate.key)
                    ]
                    measuring.save(file, record)
                record = json.loads(file.read_text())
                found = [e for e in record if any(word in text for word in PENETRATIONS for text in e["warnings"])]
                flagged += [f"{name} {shown} {e['id']} {e['reward']:.2f}: {'; '.join(e['warnings'])}" for e in found]
                solutions = sum(e["solution"] for e in record)
                earn = sum(e["reward"] >= FOUND for e in record if not e["solution"])
                cells = (name, shown, solutions, len(record) - solutions, earn, len(found))
                lines.append(f"| {' | '.join(map(str, cells))} |")
                console.print(lines[-1], highlight=False)
    sys.stdout.write("\n".join([*lines, "", *flagged]) + "\n")


if __name__ == "__main__":
    command(lambda _: main())
