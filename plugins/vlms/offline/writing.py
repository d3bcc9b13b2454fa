"""Write designs as a designs document has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from core.design import DesignError, Tool
from core.designs.tool_fields import NOTE
from core.interfaces import Anchor, Brief, Waypoints
from plugins.vlms.offline.heads import Step
from plugins.vlms.offline.job import Job
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.making import Made
from plugins.vlms.offline.notes import write_note

_DIGITS = 5  # hundredths of a millimetre
_ROUNDS = 2  # of a plan that looks
_APART_M = 0.03  # bodies that are nearer give no direction


def write_design(
    plans: Sequence[Made], brief: Brief, layout: Layout, parents: Sequence[str]
) -> dict[str, Any]:
    """Write a tool with its plans.

    Args:
        plans: one or more for one tool.
        brief: says how tools and plans are written.
        layout: where the plans were made.
        parents: the ids of the candidates that it comes from.
    """
    fields = write_names(plans, brief, parents)
    fields["action_description"] = " | ".join(_describe(made) for made in plans)
    fields["action_sets"] = [
        write_plan(made, brief, layout, looks=number % 2 == 0)
        for number, made in enumerate(plans)
    ]
    return fields


def write_names(
    plans: Sequence[Made], brief: Brief, parents: Sequence[str]
) -> dict[str, Any]:
    """Write a tool without its plans, and what they were made of; see `write_design`."""
    first = plans[0]
    way = first.option.way
    names = ", ".join(first.option.jobs[0].want.bodies[:3])
    origin = f" Bred from {' and '.join(parents)}." if parents else ""
    fields: dict[str, Any] = {
        "strategy_name": f"{way.name} {names}",
        "strategy_description": f"A tool that {way.title}.{origin}",
        **write_tool(first.tool, brief),
        NOTE: write_note(plans),
    }
    if parents:
        fields["parents"] = list(parents)
    return fields


def write_tool(tool: Tool, brief: Brief) -> dict[str, Any]:
    """Write the fields of a tool; of one that is given there are none but the gripper."""
    if brief.representation.given(brief.task) is not None:
        return {"gripper": tool.gripper}

    return {
        "tool_name": tool.name,
        "tool_description": tool.description,
        "gripper": tool.gripper,
        **brief.representation.dump(tool),
    }


def write_plan(
    made: Made, brief: Brief, layout: Layout, *, looks: bool = False
) -> list[Any]:
    """Write a plan, by what its waypoints stand by.

    Args:
        made: the plan.
        brief: says how plans are written.
        layout: where it was made.
        looks: whether it is done again until the goal is seen to be reached, if plans may look, and nothing is held.
    """
    rows = np.round(made.rows, _DIGITS) + 0.0
    steps = brief.actions.anchor(Waypoints(rows), choose_anchors(made), layout.seen)
    if not (looks and brief.actions.looks) or made.tool.gripper:
        return steps

    goal = {"goal": made.option.jobs[0].want.number}
    again = {
        "repeat": [*steps, {"look": True}],
        "until_seen": goal,
        "at_most": _ROUNDS,
    }
    try:
        brief.actions.parse([again], gripper=False)
    except DesignError:  # it would take too long
        return steps
    return [again]


def _describe(made: Made) -> str:
    """Say what a plan does, with the values of its parameters."""
    moves = made.option.way.moves
    values = [f"{name} {made.recipe.values[name]:.3g}" for name in moves]
    return f"{made.option.way.name}: {', '.join(values)}"


def choose_anchors(made: Made) -> list[Anchor]:
    """Choose what each waypoint stands by: the bodies until they are touched, and then more and more their goal."""
    anchors = []
    for number, job in enumerate(made.option.jobs):
        steps = [w.step for w in made.waypoints if w.number == number]
        base = _choose_base(job)
        shares = [0.0] * len(steps)
        if base.toward and job.goes:
            shares = _share_way(steps, job.length)

        for share in shares:
            anchors.append(Anchor(base.name, base.axes, base.toward, share))

    return anchors


def _share_way(steps: Sequence[Step], length: float) -> list[float]:
    """Say which share of the bodies' way, of a length along x, lies behind each step: none until one touches them."""
    touching = [number for number, step in enumerate(steps) if step.touch]
    first = min(touching, default=len(steps))
    begin = steps[max(first - 1, 0)].pose.position[0]
    shares = [0.0] * first
    for step in steps[first:]:
        ahead = step.pose.position[0] - begin
        share = float(np.clip(ahead / length, 0.0, 1.0))
        shares.append(round(share, 3))

    return shares


def _choose_base(job: Job) -> Anchor:
    """Choose the frame in which a job's bodies are taken: one of theirs, or of what is around them."""
    reference = job.want.reference
    holder = job.holder
    if holder is not None:
        return Anchor(holder, axes="anchor")
    if len(job.want.bodies) > 1:
        return Anchor(toward=reference)

    (name,) = job.want.bodies
    if reference not in ("", name) and job.length > _APART_M:
        return Anchor(name, toward=reference)
    return Anchor(name, axes="anchor")
