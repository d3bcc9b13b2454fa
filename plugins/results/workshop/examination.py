"""Look at designs as those who make and run them do: where they are tried, before and after."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

from core.design import Candidate, DesignError, Tool
from core.interfaces import Condition, Material, Robot, Trial
from core.scene import Scene
from core.solids.self_collision import DEEP_M
from core.support.templates import macros
from core.values.printers import Printer
from plugins.results.workshop.clearance import clearance
from plugins.results.workshop.life_size import to_life
from plugins.results.workshop.printing import THICKEN, Check
from plugins.results.workshop.replay import (
    RECORD_HZ,
    PlayedMotion,
    Unplayable,
)
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.stage import Stage
from plugins.results.workshop.strength import measured
from plugins.results.workshop.tool import PrintedTool, make_tool
from plugins.results.workshop.verdicts import SAFETY, carried, strong

MARGIN_M = 0.005
"""The least distance of the arm from itself and from what is fixed."""

PROBLEM = "not buildable: "
"""How it begins what speaks against a design."""

EXPORTED = "exported"
"""The figure of a trial with the reward of the exported motion."""


@dataclass(frozen=True)
class Examination:
    """Looks at designs as those who make and run them do; see `core.trial.Examiner`.

    Attributes:
        material: of the tools.
        printer: makes them.
        safety: the least safety factor.
        margin_m: the least distance of the arm from itself and from what is fixed, metres.
        plays: play the motion once more as it is exported, with forces. What speaks against the design then becomes
            objections of the trial. The figures are the least safety factor, the least distance in metres, and the
            reward of the exported motion.
    """

    material: Material
    printer: Printer
    safety: float = SAFETY
    margin_m: float = MARGIN_M
    plays: bool = True

    def refuse(self, condition: Condition, candidate: Candidate) -> str | None:
        """Say what speaks against making or carrying a tool, if anything does."""
        tool = candidate.tool
        if tool is None or not tool.components:
            return None

        robot = condition.task.shared().robot
        own = to_life(robot).tool(tool)
        failing = find_problem(own, robot.life_size, self.material, self.printer)
        return f"{PROBLEM}{failing}" if failing else None

    def examine(
        self, condition: Condition, candidate: Candidate, trial: Trial
    ) -> Trial:
        """Add figures and objections of the exported motion to a trial that earned something with a tool."""
        tool = candidate.tool
        if not self.plays or trial.status != "ok" or trial.reward <= 0:
            return trial
        if tool is None or not tool.components:
            return trial

        try:
            figures, problems = self._play(condition, candidate.of(trial.task), tool)
        except (Unplayable, DesignError) as error:
            figures = {EXPORTED: 0.0}
            problems = [str(error)]

        objections = tuple(f"{PROBLEM}{problem}" for problem in problems)
        return replace(trial, figures=figures, objections=objections)

    def _play(
        self, condition: Condition, candidate: Candidate, tool: Tool
    ) -> tuple[dict[str, float], list[str]]:
        """Play the motion as it is exported.

        Args:
            condition: where the candidate was tried.
            candidate: with the plan for the condition's task.
            tool: the candidate's.

        Returns:
            Figures by name, and what speaks against the design.
        """
        task = condition.task.shared()
        scene = condition.scene().furnished(tool)
        stage = Stage({condition.sim.name: condition}, scene)
        life = stage.to_life
        robot = task.robot.life_size
        own = life.tool(tool)
        played = stage.play_design(candidate, own, RECORD_HZ)
        (replay,) = played.replays.values()

        own_scene = life.scene(scene)
        printed = print_tool(own, robot, self.material, self.printer)
        rows = measured(printed, robot, own_scene, played.motion, played.replays)
        verdicts = strong(self.material, rows, task, self.safety)
        problems = [str(verdict) for verdict in verdicts if verdict.passed is False]

        near_m, too_near = self._find_clearance(own_scene, robot, own, replay)
        if too_near is not None:
            problems.append(too_near)

        figures = {EXPORTED: replay.reward, "clearance_m": round(near_m, 4)}
        factors = [row.safety for row in rows if row.safety is not None]
        if factors:
            figures["safety_factor"] = round(min(factors), 3)

        return figures, problems

    def _find_clearance(
        self, scene: Scene, robot: Robot, tool: Tool, replay: PlayedMotion
    ) -> tuple[float, str | None]:
        """Find how near the arm comes to itself or to what is fixed.

        Args:
            scene: its bodies.
            robot: the arm.
            tool: what it holds.
            replay: the motion as it was played.

        Returns:
            Metres, and what speaks against the design; None: it is far enough.
        """
        fixed = {"itself", *(body.name for body in scene.bodies if body.fixed)}
        near = [
            row
            for row in clearance(scene, robot, tool, replay.recording)
            if row.what == "arm" and row.to in fixed
        ]

        def to_spare(name: str, metres: float) -> float:
            # Hulls of links are this deep in each other where nothing is wrong.
            allowed = DEEP_M if name == "itself" else 0.0
            return metres - self.margin_m + allowed

        closest = min(near, key=lambda row: to_spare(row.to, row.metres))
        if to_spare(closest.to, closest.metres) >= 0:
            return closest.metres, None

        words = macros("plugins.results.workshop", "words")
        return closest.metres, words.clearance(closest, self.margin_m)


def _check_fixture(tool: Tool, min_wall_mm: float) -> list[Check]:
    """Check how thin the components of a tool's fixture are, as walls of what is printed."""
    if tool.fixture is None:
        return []

    checks = []
    for part in tool.fixture.parts.parts:
        wall = 1000 * part.shape.thickness
        text = f"thinnest {wall:.2f} mm, at least {min_wall_mm:g} mm"
        of_fixture = f"{part.component} of the fixture"
        checks.append(Check("walls", wall >= min_wall_mm, text, THICKEN, of_fixture))

    return checks


@lru_cache(maxsize=16)
def print_tool(
    tool: Tool, robot: Robot, material: Material, printer: Printer
) -> PrintedTool:
    """Make a tool as an export does."""
    return make_tool(tool, robot, material, printer, Fit())


def find_problem(
    tool: Tool, robot: Robot, material: Material, printer: Printer
) -> Check | None:
    """Find what fails of a tool as an export makes and checks it; its weight is the material's, and no fault."""
    verdicts = carried(tool, robot, material)
    if all(verdict.passed for verdict in verdicts):
        printed = print_tool(tool, robot, material, printer)
        verdicts = [*printed.verdicts, *_check_fixture(tool, printer.min_wall_mm)]

    for verdict in verdicts:
        if verdict.passed is False and verdict.name != "weight":
            return verdict

    return None
