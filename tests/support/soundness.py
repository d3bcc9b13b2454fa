"""Check what must hold of every candidate, from any source."""

from __future__ import annotations

import numpy as np

from core.design import Candidate
from core.designs.plan_rules import MAX_ANGLE_RAD, MAX_REACH_M, MAX_WAYPOINTS
from core.designs.rules import (
    MAX_COMPONENT_KG,
    MAX_COMPONENTS,
    MAX_DENSITY,
    MAX_EXTENT_M,
    MAX_SIDE_M,
    MIN_COMPONENT_KG,
    MIN_DENSITY,
    MIN_SIDE_M,
    MIN_TOOL_KG,
)
from tests.support.panda import PANDA

MAX_TEXT = 5000


def check_candidate(candidate: Candidate) -> None:
    """Check that texts can be shown anywhere and a problem is readable; without one, tool and plan keep the rules."""
    tool = candidate.tool
    texts = [
        candidate.design_name,
        candidate.design_description,
        candidate.action_description,
    ]
    names = [] if tool is None else [component.name for component in tool.components]
    texts += [] if tool is None else [tool.name, tool.description]
    for text in (*texts, *names, candidate.problem or ""):
        assert text.isprintable()
        assert len(text) <= MAX_TEXT
        text.encode()
    assert all(set(name) <= _NAME for name in names)
    assert candidate.problem is None or candidate.problem.strip()
    if candidate.problem is not None:
        return
    assert tool is not None
    assert 1 <= len(tool.components) <= MAX_COMPONENTS
    assert len(set(names)) == len(names)
    assert MIN_TOOL_KG <= tool.mass <= PANDA.payload_kg
    for component in tool.components:
        assert all(MIN_SIDE_M <= side <= MAX_SIDE_M for side in component.shape.size)
        assert MIN_COMPONENT_KG <= component.mass <= MAX_COMPONENT_KG
        assert MIN_DENSITY <= component.mass / component.shape.volume <= MAX_DENSITY
        assert np.linalg.norm(tool.placed()[component.name][1].position) <= MAX_EXTENT_M
    plan = candidate.plan.poses
    assert plan.shape[1] == (7 if tool.gripper else 6)
    assert 1 <= len(plan) <= MAX_WAYPOINTS
    assert np.isfinite(plan).all()
    assert (np.abs(plan[:, :3]) <= MAX_REACH_M).all()
    assert (np.abs(plan[:, 3:6]) <= MAX_ANGLE_RAD).all()
    tool.placed()


_NAME = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.-")
