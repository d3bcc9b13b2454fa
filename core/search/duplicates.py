"""Notice candidates that hardly differ from one before, so that they need not be tried."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Candidate, Tool
from core.designs.rules import NEAR_M, PATH_M, PATH_RAD
from core.errors import RAISED
from core.geometry import Array, Mesh, Pose
from core.values.plans import ActionPlan, Seen, content_of

NEAR_MASS = 0.05  # between the masses of two components, as a share

_CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
_AXES = 0.1 * np.vstack([np.zeros(3), np.eye(3)])  # points that show how a frame is turned


@dataclass(frozen=True, eq=False)
class _Compared:
    """What is compared of a candidate: ``structure`` exactly, all else within limits."""

    candidate: Candidate
    structure: object
    points: Array  # (P, 3) of the tool, in the frames of what bears them
    masses: Array  # of the tool's components
    positions: Array  # (N, 3) of the waypoints, with ``rotations``
    rotations: Rotation

    def near(self, other: _Compared) -> bool:
        """Report whether this is a near-duplicate of another one with the same structure."""
        return bool(
            self.points.shape == other.points.shape
            and (np.linalg.norm(self.points - other.points, axis=1) <= NEAR_M).all()
            and (np.abs(self.masses - other.masses) <= NEAR_MASS * np.maximum(self.masses, other.masses)).all()
            and (np.linalg.norm(self.positions - other.positions, axis=1) <= PATH_M).all()
            and ((self.rotations.inv() * other.rotations).magnitude() <= PATH_RAD).all()
        )


class NearDuplicates:
    """The candidates of a run that are tried, among which near-duplicates are looked for.

    Candidates come in the order of their replies, which may differ from run to run. So each is compared only with those
    of earlier generations, and with those before it in its own reply.
    """

    def __init__(self) -> None:
        self._earlier: dict[object, list[_Compared]] = {}
        self._now: dict[int, dict[object, list[_Compared]]] = {}  # by agent

    def next_generation(self) -> None:
        """Begin another generation."""
        every = [of for by_structure in self._now.values() for found in by_structure.values() for of in found]
        for of in sorted(every, key=lambda of: of.candidate.key):
            self._earlier.setdefault(of.structure, []).append(of)
        self._now = {}

    def first(self, candidate: Candidate) -> Candidate | None:
        """Return the first candidate of which this one is a near-duplicate; None: there is none, and it is one to try.

        What a search varied is compared with nothing: it differs by little on purpose.
        """
        figures = None if candidate.varied else _figures(candidate)
        if figures is None:
            return None
        own = self._now.setdefault(candidate.agent, {}).setdefault(figures.structure, [])
        before = [*self._earlier.get(figures.structure, ()), *own]
        found = next((other.candidate for other in before if figures.near(other)), None)
        if found is None:
            own.append(figures)
        return found


def _figures(candidate: Candidate) -> _Compared | None:
    tool, plan = candidate.tool, candidate.plan
    if tool is None or candidate.problem is not None:
        return None
    try:
        waypoints = plan.resolve(_somewhere(plan))
        positions, rotations = waypoints.poses[:, :3], Rotation.from_euler("xyz", waypoints.poses[:, 3:6])
        grips = tuple(waypoints.grips.tolist())
    except RAISED:  # a plugin's plan may look at other things than its anchors
        return None
    asked = content_of((waypoints.tempo, waypoints.guards))
    motion = type(plan).__name__, plan.anchors, grips, waypoints.poses.shape, asked
    masses = np.array([component.mass for component in tool.components])
    return _Compared(candidate, (_structure(tool), motion), _points(tool), masses, positions, rotations)


def _somewhere(plan: ActionPlan) -> Seen:
    """A layout in which all anchors of a plan are apart; where they are makes no difference to two plans' distance."""
    names = {name: None for anchor in plan.anchors for name in (anchor.name, anchor.toward) if name}
    return Seen({name: Pose(np.array([1.0 + number, 0.0, 0.0])) for number, name in enumerate(names)})


def _structure(tool: Tool) -> object:
    """What two tools must share: components, what these hang from, their kinds, joints and friction."""
    number = {name: i for i, name in enumerate((*tool.mounts, *(c.name for c in tool.components)))}
    components = tuple((number[c.parent], content_of(c.joint)) for c in tool.components)
    return tool.gripper, tool.friction, components, tuple(type(part.shape).__name__ for part in tool.parts)


def _points(tool: Tool) -> Array:
    """The corners of all shapes, and points of the frames that joints move."""
    found = [bearer.pose.apply(_AXES) for bearer in tool.bearers]
    for part in tool.parts:
        middle, size = part.shape.bounds
        corners = part.shape.vertices if isinstance(part.shape, Mesh) else middle + size * _CORNERS
        found.append(part.pose.apply(corners))
    return np.vstack([np.empty((0, 3)), *found])
