"""Find where a joint trajectory drives the arm through itself, or the tool through the arm.

Engines can't say: in none of them do the arm's links touch each other. All is computed from the robot's description
and its collision shapes, so that the answer is the same for every engine.

Pairs are first compared as capsules, all samples at once. What comes near is followed with Coal by conservative
advancement (B. Mirtich, "Impulse-based dynamic simulation of rigid body systems", PhD thesis, Berkeley 1996).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pinocchio as pin

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory
from core.robot.kinematics import RobotModel, joint_frames, joint_values, robot_model
from core.robot.solids import Solid, bounding_box, corners
from core.solids.bodies import link_solids, tool_solids
from core.values.robots import Robot

# Depth that counts, metres. Hulls are larger than the links: of the poses in which two hulls overlap by more than this,
# the arm's meshes touch in 94 %.
DEEP_M = 0.005
# The same for links of the gripper and the link two joints before it, whose hull has the largest hollow.
DEEP_NEAR_M = 0.02
# Limits of joints keep links apart that are joined by fewer than three; what hangs on the flange, by fewer than two.
_APART, _APART_ON_FLANGE = 3, 2

_SAMPLE_M = 0.15  # farthest motion of any point between two samples of the first comparison
_STEP_M = 0.001  # shortest step: a depth of less than this beyond the limit may be missed
# Distances measured for one plan. Reference solutions need a few hundred; a plan that needs more grazes the arm all the
# way, with many components.
MAX_DISTANCES = 50_000
_BLOCK = 500_000  # gaps between capsules that are computed at once; each needs some 200 bytes


@dataclass(frozen=True)
class SelfCollision:
    """Two parts of the robot and how deep one is in the other, metres, at ``time_s`` of the motion, when deepest.

    ``with_tool``: the first is a component of the tool. ``unchecked``: the search was given up here, since parts were
    near each other all the way until then (`MAX_DISTANCES`).
    """

    time_s: float
    part: str
    other: str
    depth_m: float
    with_tool: bool
    unchecked: bool = False

    def describe(self, arrivals: Array) -> str:
        """Say which part is in which, how deep, when, and on the way to which of the waypoints, by their arrivals."""
        whole = "the tool's" if self.with_tool else "the arm's"
        way = f"on the way to waypoint {int(np.searchsorted(arrivals, self.time_s)) + 1}"
        if self.unchecked:
            near = f"stays so near the arm's {self.other!r}, as others do, that collisions can't be ruled out"
            return f"{whole} {self.part!r} {near}: the search was given up at {self.time_s:.2f} s, {way}"
        depth = f"{self.depth_m * 1000:.0f} mm inside the arm's {self.other!r}"
        return f"{whole} {self.part!r} is {depth} at {self.time_s:.2f} s, {way}"

    @property
    def mend(self) -> str:
        """Say what to change."""
        bend = ", or bend the tool around the arm" if self.with_tool else ""
        return f"move or turn this waypoint or the one before it, so that the arm stays clear of itself{bend}"


class _Pairs(NamedTuple):
    """P pairs of N solids in the frames of the joints that move them, with a capsule around each.

    Attributes:
        solids: N of them; ``ends`` (N, 2, 3) are those of the capsules' axes, and ``radii`` (N,) their radii.
    """

    solids: tuple[Solid, ...]
    ends: Array
    radii: Array
    numbers: npt.NDArray[np.intp]  # (P, 2) of the solids
    deep: Array  # (P,) the depth that counts, metres
    levers: Array  # (P, J) how far a joint moves one in the frame of the other at most, metres per radian or per metre


def find_self_collision(robot: Robot, tool: Tool, trajectory: JointTrajectory) -> SelfCollision | None:
    """Find the first two parts of the robot that a trajectory's targets drive into each other.

    Targets are linear between instants, and all of the motion is covered: two parts deeper in each other than
    ``DEEP_M`` and a millimetre are found however short it lasts. Left out are pairs that the limits of one or two
    joints keep apart, a component and the link that bears it, and what hangs on one finger with what hangs on the
    other: fingers close until they meet something. Work is bounded: see `SelfCollision.unchecked`.
    """
    pairs, model = _pairs(robot, tool), robot_model(robot, tool.gripper)
    joints = joint_values(robot, tool.gripper, trajectory.arm, np.column_stack([trajectory.fingers] * 2))
    turned = np.vstack([np.zeros(joints.shape[1]), np.cumsum(np.abs(np.diff(joints, axis=0)), axis=0)])
    rows, near = _near(model, pairs, joints, turned)
    first, collided = np.inf, None
    budget, unchecked = iter(range(MAX_DISTANCES)), False
    for pair in np.flatnonzero(near.any(axis=1)):
        search = _Search(model, pairs, int(pair), joints, turned, budget)
        try:
            row = search.first(rows[:-1][near[pair]], rows[1:][near[pair]], first)
        except _GivenUp as given_up:
            if collided is None:
                first, collided, unchecked = given_up.row, search, True
            break
        if row is not None:
            first, collided = row, search
    if collided is None:
        return None
    depth, row = (collided.depth(first), first) if unchecked else collided.deepest(first)
    time, one = float(np.interp(row, np.arange(len(joints)), trajectory.times)), collided.one.name
    return SelfCollision(time, one, collided.other.name, depth, one not in model.links, unchecked)


def self_distances(robot: Robot, tool: Tool, arm: Array, fingers: Array) -> Array:
    """Measure the least distance (T,) between parts that may collide, metres, at joints (T, J) and fingers (T, F).

    It is negative for penetration. Hulls of links overlap a little where nothing is wrong: see ``DEEP_M``.
    """
    pairs, model = _pairs(robot, tool), robot_model(robot, tool.gripper)
    gauges = [_Gauge(model, *(pairs.solids[number] for number in numbers)) for numbers in pairs.numbers]
    joints = joint_values(robot, tool.gripper, arm, fingers)
    return np.array([min((-gauge.depth(row) for gauge in gauges), default=np.inf) for row in joints])


@lru_cache(maxsize=8)
def _pairs(robot: Robot, tool: Tool) -> _Pairs:
    model, links = robot_model(robot, tool.gripper), link_solids(robot, tool.gripper)
    # Where bearers will be, only the engine knows.
    mounted = [solid for solid in tool_solids(robot, tool) if solid.frame < len(model.parents)]
    count, solids = len(mounted), (*mounted, *links)
    limits = {(one + count, other + count): deep for (one, other), deep in _link_limits(robot, tool.gripper).items()}
    for (one, part), (other, link) in product(enumerate(mounted), enumerate(links, start=count)):
        if part.frame != link.frame and not _on_two_fingers(model, part, link):
            limits[one, other] = DEEP_M
    numbers = np.array(list(limits), dtype=np.intp)
    reach = [_levers(model, solid, robot.opening_m) for solid in mounted]
    levers = np.array([*reach, *_link_levers(robot, tool.gripper)])
    fixed = levers == 0.0
    one, other = numbers.T
    moving = levers[one] * fixed[other] + levers[other] * fixed[one]
    ends, radii = zip(*map(_capsule, solids), strict=True)
    return _Pairs(solids, np.array(ends), np.array(radii), numbers, np.array(list(limits.values())), moving)


def _capsule(solid: Solid) -> tuple[Array, float]:
    """Fit a capsule around a solid, along the longest axis of its bounding box: its axis' ends (2, 3), its radius."""
    middle, half = bounding_box(solid.geometry)
    longest, across = int(half.argmax()), corners(solid.geometry) - middle
    along, across[:, longest] = np.abs(across[:, longest]), 0.0
    off = np.sqrt((across * across).sum(axis=1))
    radius = float(off.max())
    inner = max(0.0, float((along - np.sqrt(np.maximum(radius**2 - off**2, 0.0))).max()))  # caps cover the rest
    tip = inner * np.eye(3)[longest]
    return solid.pose.apply([middle - tip, middle + tip]), radius


@lru_cache(maxsize=8)
def _link_limits(robot: Robot, gripper: bool) -> dict[tuple[int, int], float]:
    """Pairs of links that may collide, by their numbers, and the depth from which on they do."""
    model, limits = robot_model(robot, gripper), {}
    hand = {solid.name for solid in link_solids(robot, gripper)} - {solid.name for solid in link_solids(robot, False)}
    home = joint_values(robot, gripper, np.array([robot.home]), np.full((1, 2), robot.opening_m))[0]
    for (one, part), (other, link) in combinations(enumerate(link_solids(robot, gripper)), 2):
        between = model.supports[part.frame] ^ model.supports[link.frame]
        apart = sum(model.model.names[joint] in robot.arm_joints for joint in between)
        least = _APART_ON_FLANGE if hand & {part.name, link.name} else _APART
        limit = DEEP_M if apart >= _APART else DEEP_NEAR_M
        if apart >= least and _Gauge(model, part, link).depth(home) <= limit:
            limits[one, other] = limit
    return limits


def _on_two_fingers(robot: RobotModel, one: Solid, other: Solid) -> bool:
    before, behind = robot.supports[one.frame], robot.supports[other.frame]
    return bool(before - behind and behind - before)


@lru_cache(maxsize=8)
def _link_levers(robot: Robot, gripper: bool) -> tuple[Array, ...]:
    model = robot_model(robot, gripper)
    return tuple(_levers(model, solid, robot.opening_m) for solid in link_solids(robot, gripper))


def _levers(robot: RobotModel, solid: Solid, opening_m: float) -> Array:
    """How far each joint (J,) moves any point of a solid at most, metres per radian or per metre."""
    levers, points = np.zeros(robot.model.njoints - 1), solid.pose.apply(corners(solid.geometry))
    joint, reach = solid.frame, float(np.linalg.norm(points, axis=1).max())
    while joint:
        slides, apart = _joint(robot, joint, opening_m)
        lever = reach
        if joint == solid.frame:  # from the axis, not from the origin
            lever = float(np.linalg.norm(np.cross(robot.axes[joint][0], points), axis=1).max())
        levers[joint - 1] = 1.0 if slides else lever
        reach += apart
        joint = robot.parents[joint]
    return levers


@lru_cache(maxsize=64)
def _joint(robot: RobotModel, joint: int, opening_m: float) -> tuple[bool, float]:
    """Whether a joint slides, and how far its frame is from that of the joint before it at most, metres."""
    slides = bool(robot.axes[joint][1].any())
    return slides, float(np.linalg.norm(robot.model.jointPlacements[joint].translation)) + slides * opening_m


class _Gauge:
    """Measures the penetration depth of two solids by the joints' values, in Pinocchio alone: fifteen times as fast."""

    def __init__(self, robot: RobotModel, one: Solid, other: Solid) -> None:
        self._robot, self._solids = robot, pin.GeometryModel()
        for name, solid in zip("ab", (one, other), strict=True):
            place = pin.SE3(solid.pose.rotation.as_matrix(), solid.pose.position)
            self._solids.addGeometryObject(pin.GeometryObject(name, solid.frame, place, solid.geometry))
        self._solids.addCollisionPair(pin.CollisionPair(0, 1))
        self._data = pin.GeometryData(self._solids)

    def depth(self, joints: Array) -> float:
        """The depth, metres; negative if the two are apart."""
        pin.updateGeometryPlacements(self._robot.model, self._robot.data, self._solids, self._data, joints)
        return -float(pin.computeDistance(self._solids, self._data, 0).min_distance)


def _near(
    robot: RobotModel, pairs: _Pairs, joints: Array, turned: Array
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Choose samples (S + 1,) among the targets' rows, and mark where pairs may collide until the next one (P, S)."""
    moved = turned @ pairs.levers.max(axis=0)
    rows = np.searchsorted(moved, np.arange(0.0, moved[-1] + _SAMPLE_M, _SAMPLE_M)[1:-1])
    rows = np.unique([0, *rows, len(moved) - 1])
    rotations, positions = joint_frames(robot, joints[rows])
    frames, (one, other) = [solid.frame for solid in pairs.solids], pairs.numbers.T
    ends = positions[frames][:, None] + np.einsum("nsij,nej->nesi", rotations[frames], pairs.ends)  # (N, 2, S + 1, 3)
    blocks = np.array_split(ends, -(-len(one) * len(rows) // _BLOCK), axis=2)
    gaps = np.hstack([_segment_distances(b[one, 0], b[one, 1], b[other, 0], b[other, 1]) for b in blocks])
    gaps -= (pairs.radii[one] + pairs.radii[other])[:, None]
    travel = pairs.levers @ np.diff(turned[rows], axis=0).T
    least = (gaps[:, :-1] + gaps[:, 1:] - travel) / 2
    return rows, least < -pairs.deep[:, None]


def _segment_distances(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Distances (...) between segments a-b and c-d (..., 3). C. Ericson, "Real-time collision detection", 5.1.9."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (np.einsum("...i,...i", x, y) for x, y in ((u, u), (v, v), (u, v)))
    uw, vw = np.einsum("...i,...i", u, w), np.einsum("...i,...i", v, w)
    uu, vv = np.maximum(uu, 1e-12), np.maximum(vv, 1e-12)
    s = np.clip((uv * vw - uw * vv) / np.maximum(uu * vv - uv * uv, 1e-12), 0.0, 1.0)
    t = np.clip((uv * s + vw) / vv, 0.0, 1.0)
    s = np.clip((uv * t - uw) / uu, 0.0, 1.0)
    apart = w + s[..., None] * u - t[..., None] * v
    distances: Array = np.sqrt(np.einsum("...i,...i", apart, apart))
    return distances


class _GivenUp(Exception):
    """No distance is left to be measured at a row of the targets."""

    def __init__(self, row: float) -> None:
        self.row = row


class _Search:
    """One pair along the trajectory, followed with Coal. Instants are rows of the targets, with fractions.

    Each distance measured in search of the first collision is taken from ``budget``.
    """

    def __init__(
        self, robot: RobotModel, pairs: _Pairs, pair: int, joints: Array, turned: Array, budget: Iterator[int]
    ) -> None:
        self.joints, self.budget = joints, budget
        self.one, self.other = (pairs.solids[number] for number in pairs.numbers[pair])
        self.gauge = _Gauge(robot, self.one, self.other)
        self.deep = float(pairs.deep[pair])
        self.moved: Array = turned @ pairs.levers[pair]

    def depth(self, row: float) -> float:
        k = min(int(row), len(self.joints) - 2)
        here = self.joints[k]
        return self.gauge.depth(here + (row - k) * (self.joints[k + 1] - here))

    def first(self, starts: Array, stops: Array, until: float) -> float | None:
        """The first row before ``until`` at which the two are too deep in each other, from a start to its stop.

        Raises:
            _GivenUp: the budget is spent.
        """
        row = 0.0
        for start, stop in zip(starts, stops, strict=True):
            row, stop = max(row, float(start)), min(float(stop), until)
            while row <= stop:
                if next(self.budget, None) is None:
                    raise _GivenUp(row)
                depth = self.depth(row)
                if depth > self.deep:
                    return row
                row = self._after(row, max(self.deep - depth, _STEP_M))
        return None

    def _after(self, row: float, way: float) -> float:
        """The row at which no point of one can have moved farther than ``way`` metres in the frame of the other."""
        k = int(row)
        ahead = self.moved[k] + way
        if row > k:
            ahead += (row - k) * (self.moved[k + 1] - self.moved[k])
        k = int(self.moved.searchsorted(ahead, side="right")) - 1
        if k + 1 == len(self.moved):
            return np.inf
        return k + float((ahead - self.moved[k]) / (self.moved[k + 1] - self.moved[k]))

    def deepest(self, row: float) -> tuple[float, float]:
        """The largest depth from a row on until the two are apart again, metres, and its row."""
        best = self.depth(row), row
        for k in range(int(row) + 1, len(self.joints)):
            if (depth := self.depth(k)) <= 0:
                break
            best = max(best, (depth, float(k)))
        return best
