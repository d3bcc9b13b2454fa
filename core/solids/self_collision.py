"""Find where a joint trajectory drives the arm through itself, or the tool through the arm.

Engines can't say: in none of them do the arm's links touch each other. All is computed from the robot's description
and its collision shapes, so that the answer is the same for every engine.

Pairs are followed with Coal by conservative advancement (B. Mirtich, "Impulse-based dynamic simulation of rigid body
systems", PhD thesis, Berkeley 1996), the pair first that may collide first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from heapq import heappop, heappush
from itertools import combinations, product

import numpy as np
import pinocchio as pin

from core.design import Tool
from core.geometry import Array
from core.interfaces import JointTrajectory
from core.robot.kinematics import RobotModel, finger_values, joint_values, jointed, robot_model
from core.robot.solids import Solid, corners, robot_solids
from core.solids.bodies import link_solids, tool_solids
from core.values.robots import Robot

# Depth that counts, metres. Hulls are larger than the links: of the poses in which two hulls overlap by more than this,
# the arm's meshes touch in 94 %.
DEEP_M = 0.005
# The same for links of the gripper and the link two joints before it, whose hull has the largest hollow.
DEEP_NEAR_M = 0.02
# Limits of joints keep links apart that are joined by fewer than three; what hangs on the flange, by fewer than two.
_APART, _APART_ON_FLANGE = 3, 2

_STEP_M = 0.001  # shortest step: a depth of less than this beyond the limit may be missed
# Distances measured for one plan. Reference solutions need some thousand; a plan that needs more grazes the arm all the
# way, with many components.
MAX_DISTANCES = 150_000


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


class _Pairs:
    """Pairs of solids that may collide; measured by the joints' values, in Pinocchio alone: fifteen times as fast.

    Attributes:
        solids: in the frames of the joints that move them; ``numbers`` (P, 2) are those of the pairs.
        deep: (P,) the depth that counts, metres.
        levers: (P, J) how far a joint moves one in the frame of the other at most, metres per radian or per metre.
    """

    def __init__(self, robot: RobotModel, solids: Sequence[Solid], limits: dict[tuple[int, int], float]) -> None:
        self.solids, self.numbers, self.deep = solids, list(limits), list(limits.values())
        self._robot, self._geometry = robot, pin.GeometryModel()
        for number, solid in enumerate(solids):
            place = pin.SE3(solid.pose.rotation.as_matrix(), solid.pose.position)
            self._geometry.addGeometryObject(pin.GeometryObject(str(number), solid.frame, place, solid.geometry))
        for pair in self.numbers:
            self._geometry.addCollisionPair(pin.CollisionPair(*pair))
        self._data = pin.GeometryData(self._geometry)

    def levers(self, opening_m: float) -> Array:
        """Bound how far a joint moves one in the frame of the other, metres per radian or per metre: (P, J)."""
        own = np.array([_levers(self._robot, solid, opening_m) for solid in self.solids])
        one, other = np.array(self.numbers, dtype=np.intp).reshape(-1, 2).T
        apart: Array = own[one] * (own[other] == 0.0) + own[other] * (own[one] == 0.0)
        return apart

    def depth(self, pair: int, joints: Array) -> float:
        """The depth of a pair, metres; negative if the two are apart."""
        pin.updateGeometryPlacements(self._robot.model, self._robot.data, self._geometry, self._data, joints)
        return -float(pin.computeDistance(self._geometry, self._data, pair).min_distance)


def find_self_collision(robot: Robot, tool: Tool, trajectory: JointTrajectory) -> SelfCollision | None:
    """Find the first two parts of the robot that a trajectory's targets drive into each other.

    Targets are linear between instants, and all of the motion is covered: two parts deeper in each other than
    ``DEEP_M`` and a millimetre are found however short it lasts. Left out are pairs that the limits of one or two
    joints keep apart, a component and the link that bears it, and what hangs on one finger with what hangs on the
    other: fingers close until they meet something. Work is bounded: see `SelfCollision.unchecked`.
    """
    pairs, levers = _pairs(robot, tool)
    joints = joint_values(robot, tool, trajectory.arm, finger_values(robot, tool, trajectory.fingers))
    turned = np.vstack([np.zeros(joints.shape[1]), np.cumsum(np.abs(np.diff(joints, axis=0)), axis=0)])
    moved = levers @ turned.T  # (P, T) how far one has moved in the frame of the other
    waiting = [(0.0, pair) for pair in range(len(moved))]  # from which row of the targets on each may be too deep
    measured = 0
    while waiting:
        row, pair = heappop(waiting)
        depth = pairs.depth(pair, _between(joints, row))
        measured += 1
        if depth > pairs.deep[pair] or measured == MAX_DISTANCES:
            unchecked = depth <= pairs.deep[pair]
            row, depth = (row, depth) if unchecked else _deepest(pairs, pair, joints, row)
            one, other = (pairs.solids[number].name for number in pairs.numbers[pair])
            time = float(np.interp(row, np.arange(len(joints)), trajectory.times))
            with_tool = one not in robot_model(robot, Tool(gripper=tool.gripper)).links
            return SelfCollision(time, one, other, depth, with_tool, unchecked)
        after = _row_after(moved[pair], row, max(pairs.deep[pair] - depth, _STEP_M))
        if after < len(joints):
            heappush(waiting, (after, pair))
    return None


def _between(joints: Array, row: float) -> Array:
    """The joints' values at a row of the targets, with a fraction."""
    k = int(row)
    here: Array = joints[k]
    return here if k == row else here + (row - k) * (joints[k + 1] - here)


def _row_after(moved: Array, row: float, way: float) -> float:
    """The row at which no point of one can have moved farther than ``way`` metres in the frame of the other."""
    k = int(row)
    ahead = moved[k] + way
    if row > k:
        ahead += (row - k) * (moved[k + 1] - moved[k])
    k = int(moved.searchsorted(ahead, side="right")) - 1
    if k + 1 == len(moved):
        return np.inf
    return k + float((ahead - moved[k]) / (moved[k + 1] - moved[k]))


def _deepest(pairs: _Pairs, pair: int, joints: Array, row: float) -> tuple[float, float]:
    """The row from a row on at which a pair is deepest before it is apart again, and the depth, metres."""
    best = row, pairs.depth(pair, _between(joints, row))
    for k in range(int(row) + 1, len(joints)):
        depth = pairs.depth(pair, joints[k])
        if depth <= 0:
            break
        best = (float(k), depth) if depth > best[1] else best
    return best


def self_distances(robot: Robot, tool: Tool, arm: Array, fingers: Array) -> Array:
    """Measure the least distance (T,) between parts that may collide, metres, at joints (T, J) and fingers (T, F).

    It is negative for penetration. Hulls of links overlap a little where nothing is wrong: see ``DEEP_M``.
    """
    pairs, _ = _pairs(robot, tool)
    joints = joint_values(robot, tool, arm, fingers)
    return np.array([min((-pairs.depth(n, row) for n in range(len(pairs.deep))), default=np.inf) for row in joints])


@lru_cache(maxsize=8)
def _pairs(robot: Robot, tool: Tool) -> tuple[_Pairs, Array]:
    """Pair the links and the tool's components that may collide, and bound how joints move them apart."""
    model, links = robot_model(robot, tool), link_solids(robot, jointed(tool))
    # Where a joint of the tool will be, only the engine knows.
    loose = {name for name, (bearer, _) in tool.borne.items() if bearer not in tool.mounts}
    mounted = [solid for solid in tool_solids(robot, tool) if solid.name not in loose]
    count = len(mounted)
    limits = {(one + count, other + count): deep for (one, other), deep in _link_limits(robot, jointed(tool)).items()}
    for (one, part), (other, link) in product(enumerate(mounted), enumerate(links, start=count)):
        before, behind = model.supports[part.frame], model.supports[link.frame]
        on_two_fingers = before - behind and behind - before
        if part.frame != link.frame and not on_two_fingers:
            limits[one, other] = DEEP_M
    pairs = _Pairs(model, [*mounted, *links], limits)
    return pairs, pairs.levers(robot.opening_m)


@lru_cache(maxsize=8)
def _link_limits(robot: Robot, tool: Tool) -> dict[tuple[int, int], float]:
    """Pairs of links that may collide, by their numbers, and the depth from which on they do."""
    model, links = robot_model(robot, tool), link_solids(robot, tool)
    hand = {solid.name for solid in links} - {solid.name for solid in robot_solids(robot, False)}
    limits = {}
    for (one, part), (other, link) in combinations(enumerate(links), 2):
        between = model.supports[part.frame] ^ model.supports[link.frame]
        apart = sum(model.model.names[joint] in robot.arm_joints for joint in between)
        if apart >= (_APART_ON_FLANGE if hand & {part.name, link.name} else _APART):
            limits[one, other] = DEEP_M if apart >= _APART else DEEP_NEAR_M
    home = joint_values(robot, tool, np.array([robot.home]), finger_values(robot, tool, np.array([robot.opening_m])))[0]
    pairs = _Pairs(model, links, limits)
    return {both: deep for n, (both, deep) in enumerate(limits.items()) if pairs.depth(n, home) <= deep}


def _levers(robot: RobotModel, solid: Solid, opening_m: float) -> Array:
    """How far each joint (J,) moves any point of a solid at most, metres per radian or per metre."""
    levers, points = np.zeros(robot.model.njoints - 1), solid.pose.apply(corners(solid.geometry))
    joint = solid.frame
    reach = float(np.linalg.norm(points, axis=1).max())
    lever = float(np.linalg.norm(np.cross(robot.axes[joint][0], points), axis=1).max())  # from the axis
    while joint:
        slides = bool(robot.axes[joint][1].any())
        levers[joint - 1] = 1.0 if slides else lever
        reach += float(np.linalg.norm(robot.model.jointPlacements[joint].translation)) + slides * opening_m
        lever = reach
        joint = robot.parents[joint]
    return levers
