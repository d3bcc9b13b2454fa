"""``vlmgineer export RUN_FOLDER [output=DIR]``: write what a lab needs to run the best motion on a real arm.

Nothing here commands a robot.
"""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from omegaconf import MISSING, DictConfig

from core.config.compose import check_seed, node, task_part, task_parts, tool_part
from core.errors import UsageError, UserError
from core.store.reader import StoredRun
from core.support.cli import print_table, say
from core.support.files import writing
from core.support.templates import fill
from core.values.efforts import PERTURBED, Held
from plugins.results.chosen import DesignsConfig, chosen_evaluations, config_for
from plugins.results.named_folders import folders_and_overrides
from plugins.results.workshop.export import Export
from plugins.results.workshop.export_folder import new_folder, write_export
from plugins.results.workshop.life_size import to_life
from plugins.results.workshop.playback import make_export
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.slicing import ask_slicer, find_slicer
from plugins.results.workshop.tool import make_tool, write_tool

USAGE = (
    "usage: vlmgineer export RUN_FOLDER | designs=FILE task=NAME [output=DIR] [sims=[NAME,...]] [rate_hz=1000] "
    "[speed=1] [start=[RADIANS,...]] [KEY=VALUE ...]"
)

FORMATS = ("stl", "step")
NO_KERNEL = "format=step needs Open CASCADE: pip install 'cadquery-ocp-novtk>=8,<9'"


@dataclass
class ExportConfig(DesignsConfig):
    """Settings of ``vlmgineer export``, beside those of all that takes designs: the first of them is exported.

    Attributes:
        sims: engines that play the motion back.
        output: the folder to write.
        rate_hz: of the samples.
        speed: 1 is the motion as it was simulated.
        start: joints (J,) from which the arm approaches, radians; none: its home.
        fit: the clearances of what joins the tool to the arm, and its parts to each other.
        slice: the name of a slicer that says what printing takes, such as ``prusa-slicer``; empty: none is asked.
        slicer: the slicer's program, where it is not on the PATH.
        format: ``step`` writes exact solids, too.
    """

    sims: list[Any] = MISSING
    output: str = MISSING
    rate_hz: float = MISSING
    speed: float = MISSING
    start: list[float] = field(default_factory=list)
    fit: Fit = field(default_factory=Fit)
    slice: str = ""
    slicer: str = ""
    format: str = "stl"


def export(cfg: DictConfig) -> list[Export]:
    """Write the files of the first design of ``cfg.designs`` to ``cfg.output``: the tool, and its motion in the task.

    Of several tasks each has a folder of its own beside the tool.

    Raises:
        UserError: the design or a setting can't be used, there is something in the folder, or it can't be written.
    """
    check_seed(cfg.seed)
    if cfg.format not in FORMATS:
        raise UsageError(f"format={cfg.format}; possible: {', '.join(FORMATS)}")
    if cfg.format == "step" and importlib.util.find_spec("OCP") is None:
        raise UsageError(NO_KERNEL)

    program = cfg.slicer or cfg.slice
    slicer = find_slicer(program) if program else None

    output = new_folder(Path(cfg.output))
    try:
        return _export_to(output, cfg, slicer)
    except BaseException:
        with contextlib.suppress(OSError):
            output.rmdir()  # if nothing is in it
        raise


def _export_to(output: Path, cfg: DictConfig, slicer: Path | None) -> list[Export]:
    """Write the files to a new folder; see `export`.

    Args:
        output: the folder.
        cfg: the settings of the command.
        slicer: the program of a slicer; None: none is asked.
    """
    task = task_part(cfg).create()
    representation = tool_part(cfg).create()
    best = chosen_evaluations(cfg, representation, task)[0]
    tool = best.candidate.tool
    if tool is None or best.candidate.problem is not None:
        raise UserError(f"the design can't be used: {best.candidate.problem}")

    printer = representation.printer
    fit = node(cfg.fit, Fit)
    arm = task.robot.life_size
    own = to_life(task.robot).tool(tool)
    printed = make_tool(own, arm, representation.material, printer, fit)
    exports = [make_export(cfg, part, best, printed) for part in task_parts(cfg)]

    held = describe_held(Path(cfg.designs))
    found = []
    with writing(output):
        write_tool(printed, output / "tool", printer)
        if cfg.format == "step":
            from plugins.results.workshop.exact import write_step

            printed = printed.with_checks(write_step(printed, output / "tool"))

        asked = ask_slicer(slicer, printed.parts, printer, representation.material)
        printed = replace(printed, sliced=asked[0]).with_checks(*asked[1])
        for item in exports:
            folder = output / item.task.name if len(exports) > 1 else output
            found.append(write_export(item, printed, representation, folder, held))

    return found


def describe_held(designs: Path) -> list[str]:
    """Say in how many layouts the best of a run holds; nothing of a designs file, or where it was tried in none."""
    ended = StoredRun(designs).result() if designs.is_dir() else None
    if ended is None:
        return []

    places = {"further layouts": ended.held, PERTURBED: ended.perturbed}
    return [
        Held(figures.held, figures.layouts).words(where)
        for where, figures in places.items()
        if figures is not None
    ]


def configured(words: Sequence[str]) -> DictConfig:
    """Compose the configuration of this command (`config_for`).

    Raises:
        UserError: a word can't be used, or no design is given.
    """
    return config_for(words, "export", ExportConfig, USAGE)


def show(result: Export) -> None:
    """Print how a motion played, and what was not or not well checked."""
    task = result.task
    rows = []
    for engine, replay in result.replays.items():
        problems = "; ".join(replay.problems)
        if replay.reward == 0 and not problems:
            problems = f"vlmgineer evaluate with sim={engine} says why"

        rows.append((task.name, engine, replay.earned, problems))

    print_table(("task", "engine", "reward", "problems"), rows, ("reward",))

    most = max(result.limits, key=lambda joint: joint["computed_torque_share"] or 0.0)
    told = fill(
        "plugins.results.workshop",
        "played",
        motion=result.motion,
        tool=result.printed,
        payload=result.payload,
        robot=result.robot,
        most=most,
        verdicts=result.verdicts,
    )
    say(*told.rstrip("\n").split("\n"))


def main(words: list[str]) -> None:
    """Export, and print what was found.

    Raises:
        UserError: see `export`; or a check failed.
    """
    folders, overrides = folders_and_overrides(USAGE, words)
    if len(folders) > 1:
        raise UsageError(f"one folder at a time; {USAGE}")

    designs = [f"designs={folder}" for folder in folders]
    verdicts = []

    cfg = configured([*designs, *overrides])
    for result in export(cfg):
        show(result)
        verdicts += result.verdicts

    say(f"files: {cfg.output}")
    failing = [verdict for verdict in verdicts if verdict.passed is False]
    if failing:
        raise UserError(
            f"{len(failing)} of {len(verdicts)} checks failed; the files are written all the same"
        )
