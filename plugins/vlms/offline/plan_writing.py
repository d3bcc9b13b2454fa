"""Write plans as a designs document has them."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import filter as filter_names
from itertools import groupby
from string import digits
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from core.design import DesignError, Tool
from core.geometry import Array
from core.goals import Reach
from core.interfaces import Anchor, Brief, Waypoints
from plugins.vlms.offline.layouts import Layout
from plugins.vlms.offline.paths import SampledPlan
from plugins.vlms.offline.tool_parts import tool_boxes

_DIGITS = 5  # hundredths of a millimetre
_LOW_M = 0.05  # a tool that is less high over the ground works there
_BEYOND_M = 0.012  # how far below the ground a touch is looked for
_TOUCH_MPS = 0.05
_RISE_M = 0.15  # above the last waypoint, where a plan looks
_ABOVE_M = 0.02  # by which the waypoint before a descent is higher, at least
_MOST_ROUNDS = 3
_MOST_BODIES = 8  # that a block for each of them takes
_WORLD = Anchor().name


class PlanWriter:
    """Writes plans that were made for a layout.

    Args:
        brief: says how plans are written, and the goals.
        layout: of the brief's task.
    """

    def __init__(self, brief: Brief, layout: Layout) -> None:
        self._actions = brief.actions
        self._layout = layout
        self._reaches = [
            number
            for number, goal in enumerate(brief.task.goals)
            if isinstance(goal, Reach)
        ]

    def write(self, rows: Array, anchors: Sequence[Anchor]) -> list[Any]:
        """Write waypoints, (N, 6) or (N, 7), by what they stand by.

        Args:
            rows: of the end-effector in the layout.
            anchors: of each waypoint.

        Raises:
            DesignError: the actions can't say it.
        """
        rounded = np.round(rows, _DIGITS) + 0.0
        return self._actions.anchor(Waypoints(rounded), anchors, self._layout.seen)

    def write_with_guard(self, plan: SampledPlan, tool: Tool) -> list[Any]:
        """Write a plan that touches the ground where its tool is low for the first time, and corrects heights by that.

        It is written as it is if the tool stays high, or if its waypoints stand by no body.

        Args:
            plan: of the layout.
            tool: which touches the ground.
        """
        bodies = {anchor.name for anchor in plan.anchors} & {*self._layout.seen.poses}
        heights = self._heights(plan.rows, tool)
        low = np.flatnonzero((heights > -_BEYOND_M) & (heights < _LOW_M))
        if not bodies or not len(low):
            return self.write(plan.rows, plan.anchors)

        first = int(low[0])
        there = range(first + 1)

        onward = range(first, len(plan.rows))
        order = [*there, first, *onward]  # there, down, and up again
        rows = plan.rows[order]
        rows[first + 1, 2] -= heights[first] + _BEYOND_M

        steps = self.write(rows, [plan.anchors[i] for i in order])
        steps[first + 1] |= {
            "until": "touch",
            "speed": _TOUCH_MPS,
            "corrects": sorted(bodies),
            "beyond": _BEYOND_M,
        }

        return steps

    def write_with_looks(self, plan: SampledPlan, near: bool) -> list[Any]:
        """Write a plan that looks at its end, and is done again while its goal is not seen to be reached.

        What moves bodies one by one does so for those that are not seen in place. It is written as it is if no goal
        that can be seen is open, if it has a gripper, which may hold what it is about, or if its rounds would be too
        many.

        Args:
            plan: of the layout.
            near: whether it looks before the tool comes down to what it touches, too.
        """
        plain = self.write(plan.rows, plan.anchors)
        goal = self._find_goal(plan)
        gripper = plan.rows.shape[1] > 6
        if goal is None or gripper:
            return plain

        condition = self._write_condition(goal)
        if condition is None:
            return plain

        for looks_near in (True, False) if near else (False,):
            steps = [*self._write_round(plan, plain, goal, looks_near), {"look": True}]
            for rounds in range(_MOST_ROUNDS, 1, -1):
                block = {"repeat": steps, "until_seen": condition, "at_most": rounds}
                try:
                    self._actions.parse([block], gripper=gripper)
                except DesignError:
                    continue
                return [block]

        return plain

    def _write_condition(self, goal: int) -> dict[str, Any] | None:
        """Write what must be seen so that a plan is not done again; None: it can't be said.

        That is the goal. Of several bodies that are to be held up, one that is up is enough: the others would not come
        with it, and a tool that goes down again loses what it holds, or presses it into the table.

        Args:
            goal: the number of the goal.
        """
        seen = self._layout.seen
        assert seen.judge is not None
        names = {*seen.judge.names(goal)}

        for target in self._layout.analysis.goals:
            place = target.place
            several = len(target.bodies) > 1 and not target.any
            if not several or not names >= {*target.bodies} or place is None:
                continue

            lies_m = max(seen.poses[name].position[2] for name in target.bodies)
            in_the_air = place[:2] == (None, None) and place[2] is not None
            if not in_the_air or place[2] - lies_m < _RISE_M:
                continue

            pattern = self._find_pattern(target.bodies, goal)
            if pattern is None:
                return None

            above = round(float(lies_m + place[2]) / 2, _DIGITS)
            return {"body": pattern, "above": above, "enough": 1}

        return {"goal": goal}

    def _write_round(
        self,
        plan: SampledPlan,
        plain: Sequence[dict[str, Any]],
        goal: int,
        near: bool,
    ) -> list[dict[str, Any]]:
        """Write a plan as a round of a loop, at whose end the arm hides less.

        Args:
            plan: of the layout.
            plain: its steps, as they are written without a look.
            goal: the number of the goal that it is for.
            near: whether it looks before the tool comes down.
        """
        names = [anchor.name for anchor in plan.anchors]
        begin = next((k for k, name in enumerate(names) if name != _WORLD), 0)
        runs = [(name, len(list(run))) for name, run in groupby(names[begin:])]
        bodies = [name for name, _ in runs]
        looks = _find_descents(plan) if near else []

        pattern = self._find_pattern(bodies, goal)
        if pattern is None:
            steps = _insert_looks(plain, looks)
            return [*steps, *self._rise(plan, len(plain))]

        end = begin + runs[0][1]
        stage = [step | {"anchor": "it"} for step in plain[begin:end]]
        within = [k - begin for k in looks if begin < k < end]
        rise = [step | {"anchor": "it"} for step in self._rise(plan, end)]
        each = {
            "each": pattern,
            "do": [*_insert_looks(stage, within), *rise],
            "until_seen": {"goal": goal},
            "at_most": min(len(bodies), _MOST_BODIES),
        }
        return [*plain[:begin], each]

    def _rise(self, plan: SampledPlan, end: int) -> list[dict[str, Any]]:
        """Write a waypoint above the last one of a part of a plan; none, if that is high already.

        Args:
            plan: of the layout.
            end: how many waypoints the part has.
        """
        low = float(plan.rows[:end, 2].min())
        last = plan.rows[end - 1 : end].copy()
        if last[0, 2] > low + _RISE_M / 2:
            return []

        last[0, 2] += _RISE_M
        return self.write(last, plan.anchors[end - 1 : end])

    def _find_goal(self, plan: SampledPlan) -> int | None:
        """Find the goal that a plan is for: the last open one that has what it stands by, or else the last open one."""
        seen = self._layout.seen
        assert seen.judge is not None
        used = {anchor.name for anchor in plan.anchors}
        is_open = []
        for number in self._reaches:
            if seen.judge.left(number, seen.poses):
                is_open.append((bool(used & {*seen.judge.names(number)}), number))

        return max(is_open)[1] if is_open else None

    def _find_pattern(self, bodies: Sequence[str], goal: int) -> str | None:
        """Find a pattern that means several bodies, each named once, and no others; None: it is not so.

        Args:
            bodies: that a plan's parts stand by.
            goal: the number of the goal that must be about them.
        """
        seen = self._layout.seen
        assert seen.judge is not None
        pattern = f"{bodies[0].rstrip(digits)}*" if bodies else ""
        meant = filter_names([*seen.poses], pattern)
        alone = len(bodies) > 1 and sorted(bodies) == sorted(meant)
        return pattern if alone and {*bodies} <= {*seen.judge.names(goal)} else None

    def _heights(self, rows: Array, tool: Tool) -> npt.NDArray[np.float64]:
        """Compute how high a tool's lowest point is over the bodies' lowest one, at each waypoint, (N,).

        Args:
            rows: waypoints, (N, 6) or (N, 7).
            tool: with the fingers open.
        """
        analysis = self._layout.analysis

        grounds = []
        for goal in analysis.goals:
            for name in goal.bodies:
                grounds.append(analysis.world.solids[name].points[:, 2].min())

        turns = Rotation.from_euler("xyz", rows[:, 3:6]).as_matrix()
        bottoms = tool_boxes(tool).moved_to(rows[:, :3], turns).bounds[0][:, 2]
        by_waypoint = bottoms.reshape(len(turns), len(tool.components))

        return np.asarray(by_waypoint.min(axis=1, initial=np.inf) - min(grounds))


def _find_descents(plan: SampledPlan) -> list[int]:
    """Find the waypoints at which the tool is down, from above, before it touches what it moves: their numbers.

    The waypoint before each stands by the same as it does.

    Args:
        plan: of the layout.
    """
    found = []
    for touch in range(2, len(plan.touching)):
        begins = plan.touching[touch] and not plan.touching[touch - 1]
        if not begins:
            continue

        above = touch - 2
        down = touch - 1
        falls = plan.rows[above, 2] - plan.rows[down, 2] > _ABOVE_M
        anchor = plan.anchors[above]
        if falls and anchor.name != _WORLD and anchor == plan.anchors[down]:
            found.append(down)

    return found


def _insert_looks(
    steps: Sequence[dict[str, Any]], numbers: Sequence[int]
) -> list[dict[str, Any]]:
    """Insert a look before each of the steps of these numbers."""
    inserted: list[dict[str, Any]] = []
    for number, step in enumerate(steps):
        if number in numbers:
            inserted.append({"look": True})
        inserted.append(step)

    return inserted
