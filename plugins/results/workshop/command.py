"""``vlmgineer export RUN_FOLDER [output=DIR]``: write what a lab needs to run the best motion on a real arm.

Nothing here commands a robot.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from omegaconf import MISSING, DictConfig, OmegaConf

from core.config.compose import (
    check_seed,
    engines,
    node,
    task_part,
    task_parts,
    tool_part,
)
from core.design import Candidate, Tool
from core.designs.planning import resolve
from core.designs.reading import save_design
from core.errors import UsageError, UserError
from core.interfaces import RolloutSettings, Task, ToolRepresentation
from core.plugins import PluginPart
from core.robot.kinematics import arm_of
from core.robot.trajectory import Motion, plan_task_motion
from core.scene import Scene
from core.simulation.play import play as play_in
from core.store.database import writing
from core.store.reader import chosen_evaluations, config_for
from core.support.cli import folders_and_overrides, print_table, say, write_bytes
from core.trial import Condition, Evaluation
from core.values.materials import Material
from plugins.results.artifacts import save_files
from plugins.results.workshop.clearance import (
    NEAR_M,
    Nearest,
    clearance,
    margins,
    payload,
)
from plugins.results.workshop.motion import (
    STEP_S,
    PlayedMotion,
    Sampled,
    approach,
    cut,
    play,
    sample,
    to_csv,
    to_json,
)
from plugins.results.workshop.printing import Check
from plugins.results.workshop.ros import write_messages
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
    """The motion of a tool in a task, what it earned in each engine, and what the arm has to bear.

    Attributes:
        planned: the motion as it was simulated, ``motion`` as it is exported, ``moves`` with what leads to it.
        contact_s: when the robot first touches a body; None: never.
        mounted: rewards with what fixes the tool to the arm.
        checks: of the motion; ``verdicts``: of the tool, too.
    """

    task: Task
    scene: Scene
    candidate: Candidate
    planned: Motion
    motion: Sampled
    moves: dict[str, Sampled]
    replays: dict[str, PlayedMotion]
    contact_s: float | None
    printed: PrintedTool
    mounted: dict[str, float]
    checks: list[Check]
    verdicts: list[Check] = field(default_factory=list)

    @cached_property
    def payload(self) -> dict[str, Any]:
        return payload(self.task.robot, self.printed.printed)

    @cached_property
    def limits(self) -> list[dict[str, Any]]:
        return margins(self.task.robot, self.printed.printed, self.motion)

    @cached_property
    def nearest(self) -> list[Nearest]:
        """Distances in the first engine."""
        first = next(iter(self.replays.values()))
        return clearance(
            self.scene, self.task.robot, self.printed.tool, first.recording
        )

    def figures(self) -> dict[str, Any]:
        """Return all figures as data."""
        return {
            "robot": self.task.robot.name,
            "candidate": self.candidate.id,
            "duration_s": float(self.motion.times[-1]),
            "slower_than_simulated": self.motion.slower,
            "first_contact_s": self.contact_s,
            "rewards": {
                engine: replay.reward for engine, replay in self.replays.items()
            },
            "rewards_mounted": self.mounted,
            "problems": {
                engine: list(replay.problems) for engine, replay in self.replays.items()
            },
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
    output = new_folder(Path(cfg.output))
    task = task_part(cfg).create()
    representation = tool_part(cfg).create()
    best = chosen_evaluations(cfg, representation, task)[0]
    if best.candidate.tool is None or best.candidate.problem is not None:
        raise UserError(f"the design can't be used: {best.candidate.problem}")
    fit = node(cfg.fit, Fit)
    printer = node(cfg.printer, Printer)
    printed = make_tool(
        best.candidate.tool, task.robot, representation.material, printer, fit
    )
    exports = [_play(cfg, part, best, printed) for part in task_parts(cfg)]
    with writing(output):
        written = write_tool(printed, output / "tool")
        for made in exports:
            _write(
                made,
                written,
                representation,
                output / made.task.name if len(exports) > 1 else output,
            )
    return exports


def new_folder(folder: Path) -> Path:
    """Make a folder to write to.

    Raises:
        UserError: it has something in it, or can't be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = any(folder.iterdir())
    except OSError as error:
        raise UserError(f"can't write {folder}: {error}") from error
    if written:
        raise UsageError(
            f"{folder} has files in it already; choose another output=, or remove it"
        )
    return folder


def _play(
    cfg: DictConfig, part: PluginPart[Task], chosen: Evaluation, printed: PrintedTool
) -> Export:
    """Sample the motion of a task, and play it in each engine, without and with what fixes the tool to the arm."""
    settings = node(cfg.rollout, RolloutSettings)
    task = part.create()
    arm = arm_of(task.robot)
    scene = task.scene(cfg.seed)
    best = chosen.in_task(task.name)
    candidate = best.candidate
    several = f" of {task.name}" if candidate.plan is not chosen.candidate.plan else ""
    if candidate.tool is None or candidate.problem is not None:
        raise UserError(f"the design can't be used in {task.name}: {candidate.problem}")

    waypoints = resolve(candidate.plan, task, cfg.seed, settings, scene)
    planned = plan_task_motion(waypoints, task, settings)
    motion = sample(planned.trajectory, arm, cfg.rate_hz, cfg.speed)
    start = np.array(list(cfg.start) or task.robot.home, dtype=np.float64)
    moves = {
        "approach": approach(
            start, motion.positions[0], float(motion.fingers[0]), arm, cfg.rate_hz
        ),
        "trajectory": motion,
        "trajectory_slow": sample(
            planned.trajectory, arm, cfg.rate_hz, min(SLOW, cfg.speed)
        ),
    }

    sims = engines(OmegaConf.to_container(cfg.sims))  # type: ignore[arg-type]

    def replay(engine: str, tool: Tool) -> PlayedMotion:
        return play(
            task, sims[engine].create(), tool, motion, scene, cfg.seed, settings
        )

    replays = {name: replay(name, candidate.tool) for name in sims}
    searched = {
        name: _earned(Condition(part, sim, cfg.seed, settings, engine=name), best)
        for name, sim in sims.items()
    }
    rewards = {name: played.reward for name, played in replays.items()}
    checks = [compare_rewards(f"motion{several}", "as exported", rewards, searched)]
    if guarded := [
        str(number) for number, guard in enumerate(waypoints.guards, 1) if guard
    ]:
        left_out = f"exported programs have none: those of waypoint {', '.join(guarded)} are left out"
        checks.append(Check("guards", False, left_out))
    mounted: dict[str, float] = {}
    if printed.parts:
        mounted = {name: replay(name, printed.printed).reward for name in sims}
        checks.append(
            compare_rewards(f"mounted{several}", "with its mount", mounted, rewards)
        )

    touches = [
        touch
        for played in replays.values()
        for touch in played.contacts.all
        if touch.kind != "body"
    ]
    contact_s = min((touch.first_s for touch in touches), default=None)
    if contact_s is not None:
        before = cut(
            planned.trajectory,
            planned.arrivals,
            contact_s / motion.slower - STEP_S,
            arm,
        )
        if before is not None:
            moves["trajectory_before_contact"] = sample(
                before, arm, cfg.rate_hz, min(SLOW, cfg.speed)
            )
    return Export(
        task,
        scene,
        candidate,
        planned,
        motion,
        moves,
        replays,
        contact_s,
        printed,
        mounted,
        checks,
    )


def _write(
    made: Export, written: PrintedTool, representation: ToolRepresentation, output: Path
) -> None:
    """Write the sheet, the motion as samples and for ROS and controllers, figures, the checklist, and the design."""
    robot = made.task.robot
    made.verdicts[:] = printable((), made.checks)
    if written.parts:
        of_task_alone = replace(written, checks=(*made.checks, *written.checks))
        made.verdicts[:] = write_sheet(
            of_task_alone, made.task, made.scene, made.motion, made.replays, output
        )
    for name, move in made.moves.items():
        write_bytes(
            output / "motion" / f"{name}.csv", to_csv(move, robot.arm_joints).encode()
        )
        text = json.dumps(to_json(move, robot.arm_joints))
        write_bytes(output / "motion" / f"{name}.json", (text + "\n").encode())
    write_bytes(
        output / "figures.json", (json.dumps(made.figures(), indent=2) + "\n").encode()
    )
    write_bytes(output / "CHECKLIST.md", checklist(made).encode())
    write_messages(robot, made.motion, made.scene, output / "ros2")
    write_programs(robot, made.payload, made.moves, output / "programs")
    save_design(made.candidate, representation, output / "design")
    save_files(made.candidate, robot, made.planned, output / "design")


def _earned(condition: Condition, best: Evaluation) -> float:
    """Return what the search says that a design earns: in this engine, and in a run that tried it once."""
    (found,) = play_in(condition, [best.candidate])
    if found.status != "ok":
        raise UserError(
            f"the design is {found.status} in {condition.engine}: {found.reason}"
        )
    return max(found.reward, 0.0 if best.combined else best.reward)


def compare_rewards(
    name: str, said: str, earned: Mapping[str, float], asked: Mapping[str, float]
) -> Check:
    """Check that a motion earns in each engine what is asked of it, and anything at all."""
    rows = [
        f"{reward:.3f} for {asked[engine]:.3f} in {engine}"
        for engine, reward in earned.items()
    ]
    good = all(
        reward >= max(asked[engine] - SAME_REWARD, 1e-3)
        for engine, reward in earned.items()
    )
    return Check(name, good, f"{said} it earns {', '.join(rows)}")


def checklist(made: Export) -> str:
    """Write what to do at the arm, in order, with the figures of this motion."""
    start = (np.round(made.moves["approach"].positions[0], 3) + 0.0).tolist()  # no -0.0
    return filled(
        "checklist.md.j2",
        made=made,
        start=start,
        nearest=made.nearest[:LINES],
        slow=SLOW,
    )


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
        rows = [
            (one.task.name, engine, f"{of.reward:.3f}", "; ".join(of.problems))
            for engine, of in played
        ]
        print_table(("task", "engine", "reward", "problems"), rows, ("reward",))
        most = max(one.limits, key=lambda of: of["torque_share"] or 0.0)
        say(
            f"{one.motion.times[-1]:.2f} s, {one.motion.slower:.3f} times as long as simulated"
        )
        say(
            f"payload {one.payload['mass_kg']:g} kg of {one.task.robot.payload_kg:g}; most torque in {most['joint']}"
        )
        say(*(f"– {verdict}" for verdict in one.verdicts if verdict.passed is None))
        say(*(f"✗ {verdict}" for verdict in one.verdicts if verdict.passed is False))
    if failing := [
        verdict for one in made for verdict in one.verdicts if verdict.passed is False
    ]:
        count = sum(len(one.verdicts) for one in made)
        raise UserError(
            f"{len(failing)} of {count} checks failed; the files are written all the same"
        )
