"""``vlmgineer export RUN_FOLDER [output=DIR]``: write what a lab needs to run the best motion on a real arm.

Nothing here commands a robot.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import MISSING, DictConfig, OmegaConf

from core.config.compose import check_seed, engines, node, task_part, task_parts, tool_part
from core.design import Candidate, Evaluation, Tool
from core.designs.planning import resolve
from core.designs.reading import save_design
from core.designs.rules import SpawnRules
from core.errors import UsageError, UserError
from core.interfaces import RolloutSettings, Task
from core.plugins import PluginPart
from core.robot.kinematics import arm_of
from core.robot.tempo import plan_task_motion
from core.simulation.rollout import Evaluator
from core.simulation.together import of_task
from core.store.reader import chosen_evaluations, config_for
from core.support.cli import folders_and_overrides, print_table, say, write_bytes
from core.values.materials import Material
from plugins.results.artifacts import save_files
from plugins.results.workshop.clearance import NEAR_M, Nearest, clearance, margins, payload
from plugins.results.workshop.motion import STEP_S, PlayedMotion, Sampled, approach, cut, play, sample, to_csv, to_json
from plugins.results.workshop.printing import Check
from plugins.results.workshop.ros import PACKAGE, write_package
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.sheet import write_sheet
from plugins.results.workshop.texts import filled, write_programs
from plugins.results.workshop.tool import PrintedTool, make_tool, write_tool
from plugins.results.workshop.verdicts import printable

USAGE = (
    "usage: vlmgineer export RUN_FOLDER | designs=FILE task=NAME [output=DIR] [sims=[NAME,...]] [rate_hz=1000] "
    "[speed=1] [start=[RADIANS,...]] [KEY=VALUE ...]"
)
SLOW = 0.2  # of the speed: the first run on the arm
SAME_REWARD = 0.02
LINES = 8  # the nearest things, in the checklist


@dataclass
class ExportConfig:
    """Settings of ``vlmgineer export``.

    ``designs``: a run's folder, whose best is exported, or a designs file, of which it is the first. ``sims``: engines
    that play the motion back. ``rate_hz``: of the samples. ``speed``: 1 is the motion as it was simulated. ``start``:
    joints (J,) from which the arm approaches, radians; none: its home. ``printer`` and ``fit``: of the tool's parts.
    """

    task: dict[str, Any] = MISSING
    robot: dict[str, Any] = field(default_factory=dict)
    tool: dict[str, Any] = MISSING
    material: Material = field(default_factory=Material)
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    sims: list[Any] = MISSING
    seed: int = 0
    designs: str = MISSING
    top: int = 1
    output: str = MISSING
    rate_hz: float = MISSING
    speed: float = MISSING
    start: list[float] = field(default_factory=list)
    printer: Printer = field(default_factory=Printer)
    fit: Fit = field(default_factory=Fit)


@dataclass(frozen=True, eq=False)
class Export:
    """What was exported: the motion, what it earned in each engine, and what the arm has to bear."""

    task: Task
    candidate: Candidate
    motion: Sampled
    replays: dict[str, PlayedMotion]
    nearest: list[Nearest]
    limits: list[dict[str, Any]]
    payload: dict[str, Any]
    contact_s: float | None
    printed: PrintedTool
    mounted: dict[str, float]  # rewards with what fixes the tool to the arm
    checks: tuple[Check, ...]  # of the motion
    verdicts: tuple[Check, ...]

    def figures(self) -> dict[str, Any]:
        """Return all figures as data."""
        return {
            "robot": self.task.robot.name,
            "candidate": self.candidate.id,
            "duration_s": float(self.motion.times[-1]),
            "slower_than_simulated": self.motion.slower,
            "first_contact_s": self.contact_s,
            "rewards": {engine: replay.reward for engine, replay in self.replays.items()},
            "rewards_mounted": self.mounted,
            "problems": {engine: list(replay.problems) for engine, replay in self.replays.items()},
            "joints": self.limits,
            "nearest": [row._asdict() for row in self.nearest if row.metres < NEAR_M],
            "payload": self.payload,
        }


def export(cfg: DictConfig) -> list[Export]:
    """Write the files of the first design of ``cfg.designs`` to ``cfg.output``: the tool, and its motion in the task.

    Of several tasks each has a folder of its own beside the tool.

    Raises:
        UserError: the design or a setting can't be used, there is something in the folder, or it can't be written.
    """
    check_seed(cfg.seed)
    made = list[Export]()
    with whole(Path(cfg.output)) as output:
        task, representation = task_part(cfg).create(), tool_part(cfg).create()
        best = chosen_evaluations(cfg, representation, SpawnRules(task, cfg.seed))[0]
        if best.candidate.tool is None or best.candidate.problem is not None:
            raise UserError(f"the design can't be used: {best.candidate.problem}")
        fit, printer = node(cfg.fit, Fit), node(cfg.printer, Printer)
        solid = make_tool(best.candidate.tool, task.robot, representation.material, printer, fit)
        for part in task_parts(cfg):
            made.append(_export(cfg, part, best, solid, [check for one in made for check in one.checks], output))
    return made


@contextlib.contextmanager
def whole(folder: Path) -> Iterator[Path]:
    """Give a folder beside ``folder`` to write to. At the end it becomes ``folder``; after an error it is removed.

    Its name is always the same, so that what a killed export left there is found, and removed.

    Raises:
        UserError: ``folder`` has something in it, can't be written, or is being written by another export.
    """
    folder = folder.resolve()
    beside = folder.with_name(f".{folder.name[:50]}.part")
    try:
        if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
            raise UsageError(f"{folder} has files in it already; choose another output=, or remove it")
        beside.mkdir(parents=True, exist_ok=True)
        with contextlib.ExitStack() as at_end:
            handle = os.open(beside, os.O_RDONLY | os.O_NOFOLLOW)
            at_end.callback(os.close, handle)
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)  # ends with the process; an error where another has it
            for left in beside.iterdir():
                shutil.rmtree(left) if left.is_dir() and not left.is_symlink() else left.unlink()
            at_end.callback(shutil.rmtree, beside, ignore_errors=True)
            yield beside
            beside.rename(folder)
    except BlockingIOError as error:
        raise UserError(f"another export is writing {folder}") from error
    except OSError as error:
        raise UserError(f"can't write {folder}: {error}") from error


def _export(
    cfg: DictConfig, part: PluginPart[Task], chosen: Evaluation, solid: PrintedTool, earlier: list[Check], output: Path
) -> Export:
    """Write what the motion of one task needs, and the tool, with the checks of the ``earlier`` motions and of this."""
    settings, task = node(cfg.rollout, RolloutSettings), part.create()
    robot, arm, scene = task.robot, arm_of(task.robot), task.scene(cfg.seed)
    best, in_tool = of_task(chosen, task.name), output / "tool"
    candidate, of = best.candidate, ""
    if candidate.plan is not chosen.candidate.plan:  # of several tasks
        of, output = f" of {task.name}", output / task.name
    if candidate.tool is None or candidate.problem is not None:
        raise UserError(f"the design can't be used in {task.name}: {candidate.problem}")
    tool = candidate.tool
    waypoints = resolve(candidate.plan, task, cfg.seed, settings, scene)
    planned = plan_task_motion(waypoints, task, settings)
    motion = sample(planned.trajectory, arm, cfg.rate_hz, cfg.speed)
    built = solid.printed
    start = np.array(list(cfg.start) or robot.home, dtype=np.float64)
    moves = {
        "approach": approach(start, motion.positions[0], float(motion.fingers[0]), arm, cfg.rate_hz),
        "trajectory": motion,
        "trajectory_slow": sample(planned.trajectory, arm, cfg.rate_hz, min(SLOW, cfg.speed)),
    }
    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]

    def replay(engine: str, of: Tool) -> PlayedMotion:
        return play(task, sims[engine].create(), of, motion, scene, cfg.seed, settings)

    replays = {name: replay(name, tool) for name in sims}
    searched = {name: _earned(Evaluator(part, sim, cfg.seed, settings), best) for name, sim in sims.items()}
    rewards, mounted = {name: played.reward for name, played in replays.items()}, dict[str, float]()
    checks = [as_good(f"motion{of}", "as exported", rewards, searched)]
    if guarded := [str(number) for number, guard in enumerate(waypoints.guards, 1) if guard]:
        checks.append(
            Check("guards", False, f"exported programs have none: those of waypoint {', '.join(guarded)} are left out")
        )
    verdicts = printable((), checks)
    if solid.parts:
        mounted = {name: replay(name, built).reward for name in sims}
        checks.append(as_good(f"mounted{of}", "with its mount", mounted, rewards))
        solid = write_tool(replace(solid, checks=(*earlier, *checks, *solid.checks)), in_tool)
        solid = replace(solid, checks=solid.checks[len(earlier) :])
        verdicts = write_sheet(solid, tool, task, scene, motion, replays, output)
    touches = [touch for played in replays.values() for touch in played.contacts.all if touch.kind != "body"]
    contact_s = min((touch.first_s for touch in touches), default=None)  # when the robot first touches a body
    if contact_s is not None:
        before = cut(planned.trajectory, planned.arrivals, contact_s / motion.slower - STEP_S, arm)
        if before is not None:
            moves["trajectory_before_contact"] = sample(before, arm, cfg.rate_hz, min(SLOW, cfg.speed))
    near = clearance(scene, robot, tool, next(iter(replays.values())).recording)
    limits, load = margins(robot, built, motion), payload(robot, built)
    of_motion = near, limits, load, contact_s, solid, mounted, tuple(checks), tuple(verdicts)
    made = Export(task, candidate, motion, replays, *of_motion)
    _write(made, moves, output)
    write_package(robot, built, motion, scene, output / "ros2" / PACKAGE)
    write_programs(robot, made.payload, moves, output / "programs")
    save_design(candidate, tool_part(cfg).create(), output / "design")
    save_files(candidate, robot, planned, output / "design")
    return made


def _write(made: Export, moves: Mapping[str, Sampled], output: Path) -> None:
    """Write the moves as samples, what was found as data, and the checklist."""
    for name, move in moves.items():
        write_bytes(output / "motion" / f"{name}.csv", to_csv(move, made.task.robot.arm_joints).encode())
        text = json.dumps(to_json(move, made.task.robot.arm_joints))
        write_bytes(output / "motion" / f"{name}.json", (text + "\n").encode())
    write_bytes(output / "figures.json", (json.dumps(made.figures(), indent=2) + "\n").encode())
    write_bytes(output / "CHECKLIST.md", checklist(made, moves).encode())


def _earned(evaluator: Evaluator, best: Evaluation) -> float:
    """Return what the search says that a design earns: in this engine, and in a run that tried it once."""
    (found,) = evaluator([best.candidate])
    if found.status != "ok":
        raise UserError(f"the design is {found.status} in {evaluator.sim.name}: {found.reason}")
    return max(found.reward, 0.0 if best.combined else best.reward)


def as_good(name: str, said: str, earned: Mapping[str, float], asked: Mapping[str, float]) -> Check:
    """Check that a motion earns in each engine what is asked of it, and anything at all."""
    rows = [f"{reward:.3f} for {asked[engine]:.3f} in {engine}" for engine, reward in earned.items()]
    good = all(reward >= max(asked[engine] - SAME_REWARD, 1e-3) for engine, reward in earned.items())
    return Check(name, good, f"{said} it earns {', '.join(rows)}")


def checklist(made: Export, moves: Mapping[str, Sampled]) -> str:
    """Write what to do at the arm, in order, with the figures of this motion."""
    start = (np.round(moves["approach"].positions[0], 3) + 0.0).tolist()  # no -0.0
    return filled("checklist.md.j2", made=made, moves=moves, start=start, nearest=made.nearest[:LINES], slow=SLOW)


def configured(words: Sequence[str]) -> DictConfig:
    """Compose the configuration (`config_for`)."""
    return config_for(words, "export", ExportConfig, USAGE)


def main(words: list[str]) -> None:
    folders, words = folders_and_overrides(USAGE, words)
    if len(folders) > 1:
        raise UsageError(f"one folder at a time; {USAGE}")
    made = export(configured([*(f"designs={folder}" for folder in folders), *words]))
    for one in made:  # how the motion played, and what was not or not well checked
        played = one.replays.items()
        rows = [(one.task.name, engine, f"{of.reward:.3f}", "; ".join(of.problems)) for engine, of in played]
        print_table(("task", "engine", "reward", "problems"), rows, ("reward",))
        most = max(one.limits, key=lambda of: of["torque_share"] or 0.0)
        say(f"{one.motion.times[-1]:.2f} s, {one.motion.slower:.3f} times as long as simulated")
        say(f"payload {one.payload['mass_kg']:g} kg of {one.task.robot.payload_kg:g}; most torque in {most['joint']}")
        say(*(f"– {verdict}" for verdict in one.verdicts if verdict.passed is None))
        say(*(f"✗ {verdict}" for verdict in one.verdicts if verdict.passed is False))
    if failing := [verdict for one in made for verdict in one.verdicts if verdict.passed is False]:
        count = sum(len(one.verdicts) for one in made)
        raise UserError(f"{len(failing)} of {count} checks failed; the files are written all the same")
