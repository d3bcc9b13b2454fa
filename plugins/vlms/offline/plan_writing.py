"""Write plans as a designs document has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array
from core.interfaces import ActionRepresentation, Anchor, Waypoints
from plugins.vlms.offline.layouts import Layout
from plugins.vlms.offline.paths import SampledPlan
from plugins.vlms.offline.tool_parts import tool_boxes

_DIGITS = 5  # hundredths of a millimetre
_LOW_M = 0.05  # a tool that is less high over the ground works there
_BEYOND_M = 0.012  # how far below the ground a touch is looked for
_TOUCH_MPS = 0.05


class PlanWriter:
    """Writes plans that were made for a layout."""

    def __init__(self, actions: ActionRepresentation, layout: Layout) -> None:
        self._actions = actions
        self._layout = layout

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
