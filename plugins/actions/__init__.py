"""How models write action plans: ``action=waypoints`` and ``action=anchored``."""

from __future__ import annotations

from collections.abc import Mapping

from core.hooks import Factory, hookimpl


@hookimpl
def action_representations() -> Mapping[str, Factory]:
    return {
        "waypoints": "plugins.actions.waypoints:WaypointActions",
        "anchored": "plugins.actions.anchored:AnchoredActions",
    }
