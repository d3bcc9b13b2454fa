"""``action=waypoints``: a plan is a list of poses in the world, as in the paper."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from core.designs.plan_rules import MAX_ANGLE_RAD, MAX_REACH_M, WAYPOINT, check_plan
from core.geometry import Array
from core.interfaces import (
    ActionPlan,
    ActionRepresentation,
    Brief,
    JsonObject,
    Numbers,
    Waypoints,
)
from core.support.templates import fill

# Small changes, metres and radians, of a search without a model.
STEPS = np.repeat((0.01, 0.05), 3)
MOST = np.repeat((MAX_REACH_M, MAX_ANGLE_RAD), 3)
DIGITS = 5  # hundredths of a millimetre


class WaypointActions(ActionRepresentation):
    """Lists of 6 numbers, or of 7 with the gripper."""

    def instructions(self, brief: Brief) -> str:
        return fill(
            "plugins.actions", "waypoints", closes=brief.closes, fingers=brief.gripper
        )

    def schema(self, *, gripper: bool) -> JsonObject:
        count = len(WAYPOINT)
        if not gripper:
            count -= 1
        waypoint = {
            "type": "array",
            "items": {"type": "number"},
            "minItems": count,
            "maxItems": count,
        }
        return {"type": "array", "items": waypoint, "minItems": 1}

    def parse(self, data: object, *, gripper: bool) -> Waypoints:
        return Waypoints(check_plan(data, gripper=gripper))

    def dump(self, waypoints: Waypoints) -> list[Any]:
        return waypoints.dump()

    def parameters(self, plan: ActionPlan) -> Numbers:
        """Return the coordinates and angles of all waypoints."""
        if not isinstance(plan, Waypoints):
            return Numbers()
        return Numbers.near(plan.poses[:, :6], STEPS, MOST)

    def with_parameters(self, plan: ActionPlan, values: Array) -> Waypoints:
        assert isinstance(plan, Waypoints)
        poses = np.round(values.reshape(-1, 6), DIGITS)
        grips = plan.poses[:, 6:]
        return replace(plan, poses=np.hstack([poses, grips]))
