"""Judge whether a tool can be made and borne: what fails, by which figures, and what to change."""

from __future__ import annotations

import math
from collections.abc import Sequence

from core.design import Tool
from core.designs.statics import flange_moment, mass_limit, moment_limit
from core.goals import JointAt, Placed
from core.interfaces import Task
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.printing import Check, PrintedPart
from plugins.results.workshop.strength import Strength

SAFETY = 2.0  # the strength over the stress, at least
SOFT_M = 0.01  # what bends by more is noted: engines took it to be rigid
BENT = 0.5  # of the least tolerance of the task's goals: what bends by more fails
TOLERANCE_M = 0.04  # of a goal that names none

_MENDS = {  # by how the name of a check begins; the first counts
    "watertight": "let components overlap, or part them clearly",
    "one piece": "let components overlap by more than a wall",
    "walls": "thicken the thinnest component",
    "fits the plate": "shorten it, choose a larger printer, or cut and join it in the slicer",
    "clear of the arm": "lower what rises above the mount",
    "screws": "narrow or move what is below them",
    "finger": "move the attachment beyond the fingertip, or make it wider than the finger",
    "as simulated": "make hollow components thicker, or of simple shapes",
    "joint of": "each of its links is a closed body of its own",
    "apart": "leave a gap between them",
    "weight": "simulate it with material= what it is made of",
    "motion": "search in each of these engines with fitness=robust, or name in sims those that you trust",
    "mounted": "move components away from the mount, and leave more room where the motion is tight",
    "rigid": "thicken or shorten it, choose a stiffer material, or move more slowly where it pushes",
    "files read back": "write them again; if it stays, thicken what is thinner than a nozzle",
}


def carried(tool: Tool, robot: Robot, material: Material) -> list[Check]:
    """Judge whether an arm carries a tool."""
    heaviest = max(tool.components, key=lambda component: component.mass)
    mend = f"{heaviest.name} weighs most, {1000 * heaviest.mass:.0f} g: make parts thinner, shorter or fewer"
    (most, why), moment, bears = (
        mass_limit(robot, material),
        flange_moment(tool, robot),
        moment_limit(robot),
    )
    return [
        Check("mass", tool.mass <= most, f"{tool.mass:.3f} kg; {why}", mend),
        Check(
            "moment",
            moment <= bears,
            f"{moment:.2f} N m at the flange; the wrist bears {bears:g} N m",
            mend,
        ),
    ]


def printable(
    parts: Sequence[PrintedPart], checks: Sequence[Check] = ()
) -> list[Check]:
    """Name what was checked of parts by these, and add what to change; ``checks`` are those of the whole tool."""
    named = [(check.name, check) for check in checks]
    named += [
        (f"{check.name}, {part.name}", check) for part in parts for check in part.checks
    ]
    return [check._replace(name=name, mend=_mend(check.name)) for name, check in named]


def _mend(name: str) -> str:
    return next(
        (mend for begins, mend in _MENDS.items() if name.startswith(begins)), ""
    )


def strong(
    material: Material,
    strengths: Sequence[Strength],
    task: Task,
    safety: float = SAFETY,
) -> list[Check]:
    """Judge strength and stiffness of components; where all bear what they must, the weakest is named."""
    if material.strength_pa is None:
        return [
            Check(
                "strength",
                None,
                f"material={material.name} has no strength: choose one, such as material=pla",
            )
        ]
    weak = sorted(
        (row.safety, i, row)
        for i, row in enumerate(strengths)
        if row.safety is not None
    )
    failing = [of for of in weak if of[0] < safety]
    found = []
    for factor, _, row in failing or weak[:1]:
        thicker = math.ceil(10 * math.sqrt(safety / factor)) / 10
        mend = (
            f"{row.load} loads it with {row.newtons:.1f} N at {1000 * row.lever_m:.0f} mm: make {row.component} about "
            f"{thicker:g} times as thick across its thin side, shorten what it carries, or move more slowly"
        )
        bears = f"{row.stress_pa / 1e6:.1f} MPa, safety factor {factor:.2f}; at least {safety:g} is asked for"
        found.append(Check(f"strength, {row.component}", not failing, bears, mend))
    softest = max(strengths, key=lambda row: row.bend_m, default=None)
    allowed = BENT * tolerance(task)
    if softest is not None and softest.bend_m > min(SOFT_M, allowed):
        bends = f"{softest.load} bends it by {1000 * softest.bend_m:.1f} mm at {softest.component}"
        said = f"{bends}, and engines took it to be rigid; at most {1000 * allowed:.3g} mm are allowed"
        found.append(
            Check(
                "rigid",
                None if softest.bend_m <= allowed else False,
                said,
                _mend("rigid"),
            )
        )
    return found


def tolerance(task: Task) -> float:
    """Return the least tolerance of a task's goals that is a length, metres."""
    kinds = {joint.name: joint.kind for joint in task.scene(0).joints}
    lengths = [
        goal.tolerance
        for goal in task.goals
        if isinstance(goal, Placed)
        or (isinstance(goal, JointAt) and kinds.get(goal.joint) == "slider")
    ]
    return min((length for length in lengths if length > 0), default=TOLERANCE_M)
