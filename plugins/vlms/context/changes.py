"""Say in short how a design differs from the one that it comes from."""

from __future__ import annotations

import json
from collections.abc import Iterator
from difflib import SequenceMatcher
from typing import Any

import numpy as np

from core.design import Candidate, Component
from core.support.text import short_numbers

_COMPONENTS = 3  # that are named
_SAME = 1e-6  # m and rad


def describe_change(parent: Candidate, child: Candidate) -> str:
    """Say what a design changed: its components by name, and its plan.

    Args:
        parent: that it names among its parents.
        child: the design.
    """
    changes = [*_compare_tools(parent, child), _compare_plans(parent, child)]
    return "; ".join(changes)


def _compare_tools(parent: Candidate, child: Candidate) -> Iterator[str]:
    """Yield what is new, gone or different in a tool; of many components their number."""
    if parent.tool is None or child.tool is None:
        return

    before = {part.name: part for part in parent.tool.components}
    after = {part.name: part for part in child.tool.components}
    found = [
        *(f"without {name}" for name in before if name not in after),
        *(f"new {name}" for name in after if name not in before),
        *(
            f"{name} {difference}"
            for name, part in after.items()
            if name in before and (difference := _compare(before[name], part))
        ),
    ]
    yield from found[:_COMPONENTS]
    left = len(found) - _COMPONENTS
    if left > 0:
        yield f"{left} more parts differ"
    if not found:
        yield "same tool"


def _compare(before: Component, after: Component) -> str:
    """Say how a component differs; empty: it does not, but for its mass and colour."""
    changes = []
    sides = before.shape.bounds[1], after.shape.bounds[1]
    places = before.pose.position, after.pose.position
    turns = before.pose.rpy, after.pose.rpy
    for what, (old, new) in (("size", sides), ("at", places), ("rpy", turns)):
        if np.abs(new - old).max() > _SAME:
            changes.append(f"{what} {short_numbers(old, 3)} -> {short_numbers(new, 3)}")

    if before.joint != after.joint:
        changes.append("another joint")

    return ", ".join(changes)


def _compare_plans(parent: Candidate, child: Candidate) -> str:
    """Say how a plan differs: how many of its steps are new, and the first of them."""
    before = _list_steps(parent)
    after = _list_steps(child)
    if before == after:
        return "same plan"

    blocks = SequenceMatcher(None, before, after, autojunk=False).get_opcodes()
    changed = [block for block in blocks if block[0] != "equal"]
    count = sum(max(block[2] - block[1], block[4] - block[3]) for block in changed)
    _, first, first_end, *_ = changed[0]
    was = before[first] if first < first_end else "nothing"
    now = after[changed[0][3]] if changed[0][3] < changed[0][4] else "nothing"
    return f"{count} of {len(after)} steps of the plan differ, the first {was} -> {now}"


def _list_steps(candidate: Candidate) -> list[str]:
    """Write the steps of a plan, each as text."""
    written = candidate.plan.dump()
    steps = written if isinstance(written, list) else [written]
    return [_shorten(json.dumps(_round(step))) for step in steps]


def _round(step: Any) -> Any:
    """Round the numbers of a waypoint to millimetres."""
    if isinstance(step, list) and all(isinstance(value, float) for value in step):
        return [round(value, 3) + 0.0 for value in step]
    return step


def _shorten(step: str) -> str:
    return step if len(step) <= 80 else f"{step[:77]}..."
