"""Find where a joint trajectory drives the arm through itself, or the tool through the arm.

Engines can't say: in none of them do the arm's links touch each other. All is computed from the robot's description
and its collision shapes, with Pinocchio and Coal, so that the answer is the same for every engine. The steps stand in
docs/physics_explained.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
import pinocchio as pin

from core.design import Tool
from core.geometry import Array, running_sums
from core.interfaces import JointTrajectory
from core.robot.kinematics import (
    RobotModel,
    finger_values,
    jointed,
    robot_model,
)
from core.robot.solids import Solid, robot_solids
from core.solids.rollout_solids import link_solids, tool_solids
from core.values.robots import Robot

# Depth that counts, metres. Hulls are larger than the links: of the poses in which two hulls overlap by more than this,
# the arm's meshes touch in 94 %.
DEEP_M = 0.005
# The same for links of the gripper and the link two joints before it, whose hull has the largest hollow.
DEEP_NEAR_M = 0.02
# Limits of joints keep links apart that are joined by fewer than three; what hangs on the flange, by fewer than two.
_APART = 3
_APART_ON_FLANGE = 2

STEP = 0.02  # between two looks: what all joints turn (rad) or slide (m, times `_PER_METRE`) in sum
_PER_METRE = 20.0


@dataclass(frozen=True)
class SelfCollision:
    """Two parts of the robot of which one is in the other.

    Attributes:
        time_s: of the motion, when they are deepest.
        part: a link, or a component of the tool.
        other: a link.
        depth_m: how deep they are, metres.
        with_tool: whether the first is a component of the tool.
    """

    time_s: float
    part: str
    other: str
    depth_m: float
    with_tool: bool

    def describe(self, arrivals: Array) -> str:
        """Say which part is in which, how deep, when, and on the way to which of the waypoints, by their arrivals."""
        whole = "the tool's" if self.with_tool else "the arm's"
        depth = f"{self.depth_m * 1000:.0f} mm inside the arm's {self.other!r}"
        waypoint = int(np.searchsorted(arrivals, self.time_s)) + 1

        return f"{whole} {self.part!r} is {depth} at {self.time_s:.2f} s, on the way to waypoint {waypoint}"

    @property
    def mend(self) -> str:
        """Say what to change."""
        bend = ", or bend the tool around the arm" if self.with_tool else ""
        return f"move or turn this waypoint or the one before it, so that the arm stays clear of itself{bend}"


class SolidPairs:
    """Pairs of the robot's own solids that may collide, measured by the joints' values (Q,) as the model orders them.

    Args:
        robot: its kinematic model.
        solids: in the joints' frames.
        limits: for two solids' numbers the depth from which on they collide, metres.

    Attributes:
        names: the names of each pair's two solids.
        deep: (P,) the depth from which on they collide, metres.
    """

    def __init__(
        self,
        robot: RobotModel,
        solids: Sequence[Solid],
        limits: dict[tuple[int, int], float],
    ) -> None:
        self.names = [(solids[i].name, solids[j].name) for i, j in limits]
        self.deep = np.array([*limits.values()])
        self._robot = robot
        self._geometry = pin.GeometryModel()

        for number, solid in enumerate(solids):
            place = pin.SE3(solid.pose.rotation_matrix, solid.pose.position)
            self._geometry.addGeometryObject(
                pin.GeometryObject(str(number), solid.frame, place, solid.geometry)
            )

        for pair in limits:
            self._geometry.addCollisionPair(pin.CollisionPair(*pair))

        self._data = pin.GeometryData(self._geometry)
        for request, deep in zip(
            self._data.collisionRequests, self.deep.tolist(), strict=True
        ):
            request.security_margin = -deep

        # It measures only pairs whose boxes overlap.
        self._near = pin.BroadPhaseManager_NaiveCollisionManager(
            robot.model, self._geometry, self._data
        )

    def find_first(self, looks: Array) -> int | None:
        """Find the first of looks (L, Q) at which two are deeper in each other than is allowed."""
        robot = self._robot
        for number, joints in enumerate(looks):
            if pin.computeCollisions(robot.model, robot.data, self._near, joints, True):
                return number

        return None

    def depths(self, joints: Array) -> Array:
        """Measure how deep two of a pair are in each other, metres, (P,); negative if they are apart."""
        pin.computeDistances(
            self._robot.model, self._robot.data, self._geometry, self._data, joints
        )
        return np.array([-result.min_distance for result in self._data.distanceResults])


def find_self_collision(
    robot: Robot, tool: Tool, trajectory: JointTrajectory
) -> SelfCollision | None:
    """Find the first two parts of the robot that a trajectory's targets drive into each other.

    Targets are linear between instants, and are looked at each time that the joints have moved by `STEP` in sum. Left
    out are pairs that the limits of one or two joints keep apart, a component and the link that bears it, and what
    hangs on one finger with what hangs on the other: fingers close until they meet something.

    Args:
        robot: the arm.
        tool: what it holds.
        trajectory: its targets.

    Returns:
        The collision, where it is deepest; None: there is none.
    """
    pairs = self_pairs(robot, tool)
    fingers = finger_values(robot, tool, trajectory.fingers)
    joints = robot_model(robot, tool).order(trajectory.arm, fingers)
    numbers = np.arange(len(joints))
    rows = _choose_rows(robot, trajectory)
    looks = np.column_stack([np.interp(rows, numbers, values) for values in joints.T])
    first = pairs.find_first(looks)

    if first is None:
        return None

    depths = pairs.depths(looks[first])
    pair = int(np.argmax(depths - pairs.deep))
    course = [(depths[pair], rows[first])]

    for later in range(int(rows[first]) + 1, len(joints)):
        depth = pairs.depths(joints[later])[pair]
        if depth <= 0:
            break
        course.append((depth, later))

    deepest, row = max(course, key=lambda look: look[0])
    part, second = pairs.names[pair]
    time = float(np.interp(row, numbers, trajectory.times))
    with_tool = part in tool.placed()

    return SelfCollision(time, part, second, float(deepest), with_tool)


def _choose_rows(robot: Robot, trajectory: JointTrajectory) -> Array:
    """Choose when to look: each time that the joints moved by `STEP`.

    Args:
        robot: the arm.
        trajectory: of T targets.

    Returns:
        Numbers of targets, with fractions.
    """
    weights = np.where(robot.slides, _PER_METRE, 1.0)
    turned = (np.abs(np.diff(trajectory.arm, axis=0)) * weights).sum(axis=1)
    turned += _PER_METRE * np.abs(np.diff(trajectory.fingers))
    travel = running_sums(turned)
    chosen = np.linspace(0.0, travel[-1], int(travel[-1] / STEP) + 2)

    return np.interp(chosen, travel, np.arange(len(travel)))


@lru_cache(maxsize=8)
def self_pairs(robot: Robot, tool: Tool) -> SolidPairs:
    """Pair the links and the tool's components that may collide.

    A component is compared with each link but the one that bears it, and but those of the other finger.
    """
    model = robot_model(robot, tool)
    links = link_solids(robot, jointed(tool))
    # Where a joint of the tool will be, only the engine knows.
    mounted = [
        solid
        for solid in tool_solids(robot, tool)
        if tool.borne[solid.name][0] in tool.mounts
    ]
    limits = dict(_link_limits(robot, jointed(tool)))

    for first, part in enumerate(mounted, start=len(links)):
        for second, link in enumerate(links):
            before = model.supports[part.frame]
            behind = model.supports[link.frame]
            on_two_fingers = before - behind and behind - before

            if part.frame != link.frame and not on_two_fingers:
                limits[first, second] = DEEP_M

    return SolidPairs(model, [*links, *mounted], limits)


@lru_cache(maxsize=8)
def _link_limits(robot: Robot, tool: Tool) -> dict[tuple[int, int], float]:
    """Pair the links that may collide.

    Those that overlap at home already are left out: there the hulls are wrong, and not the arm.

    Returns:
        For the numbers of two links the depth from which on they collide, metres.
    """
    model = robot_model(robot, tool)
    links = link_solids(robot, tool)
    arm = {solid.name for solid in robot_solids(robot, False)}
    limits = {}

    for (first, part), (second, link) in combinations(enumerate(links), 2):
        between = model.supports[part.frame] ^ model.supports[link.frame]
        apart = sum(model.model.names[joint] in robot.arm_joints for joint in between)
        of_arm = {part.name, link.name} <= arm

        if apart >= (_APART if of_arm else _APART_ON_FLANGE):
            limits[first, second] = DEEP_M if apart >= _APART else DEEP_NEAR_M

    fingers = finger_values(robot, tool, np.array([robot.opening_m]))
    home = model.order(np.array([robot.home]), fingers)[0]
    depths = SolidPairs(model, links, limits).depths(home)

    return {
        pair: deep
        for (pair, deep), depth in zip(limits.items(), depths, strict=True)
        if depth <= deep
    }
