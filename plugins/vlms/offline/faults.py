"""Count what is wrong with a plan: unwanted collisions, waypoints out of reach, and layouts in which it does not do.

An overlap of two boxes counts 1, a metre of missed reach 100, and an arm that meets itself `BREAKS_RULES`. The boxes
are those of the tool, with the hand where there is one, at places along the straight ways between waypoints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from core.design import Tool
from core.geometry import Array, Pose, step_lengths
from core.interfaces import Anchor, Brief, Waypoints
from core.robot.kinematics import Arm, arm_of
from core.robot.trajectory import plan_motion
from core.solids.self_collision import find_self_collision
from plugins.vlms.offline.boxes import Boxes, count_overlaps
from plugins.vlms.offline.layouts import Layout
from plugins.vlms.offline.paths import SampledPlan
from plugins.vlms.offline.plan_writing import PlanWriter
from plugins.vlms.offline.scene_model import SceneModel
from plugins.vlms.offline.subgoals import Subgoal
from plugins.vlms.offline.tool_parts import HAND, tool_boxes

BREAKS_RULES = 1000.0
"""The fault of a design that is refused."""

_MISS_M = 0.005  # error of inverse kinematics that is not a fault
_PER_METRE = 100.0  # faults for a metre of missed reach
_TURN_M = 0.2  # of an error of inverse kinematics, for a radian: about what it moves a head by
_HOPELESS_M = 0.1  # of an error; the waypoints after it are not looked at
_STEP_M = 0.04  # between collision checks
_CONTACT_M = 0.001  # a smaller overlap is only a contact


class FaultCounter:
    """Counts the faults of plans for a brief.

        faults = FaultCounter(brief, layouts, PlanWriter(brief, layouts[0]))
        does = faults.count(tool, plan, subgoals) == 0.0

    Args:
        brief: what is asked for.
        layouts: the one that plans are made for, and others in which they must do.
        writer: of plans for the first layout.
    """

    def __init__(
        self,
        brief: Brief,
        layouts: Sequence[Layout],
        writer: PlanWriter,
    ) -> None:
        self._brief = brief
        self._layouts = layouts
        self._writer = writer

    @property
    def several(self) -> bool:
        """Whether a plan must do in several layouts."""
        return len(self._layouts) > 1

    def resolve_elsewhere(self, rows: Array, anchors: Sequence[Anchor]) -> list[Array]:
        """Compute what becomes of a plan's waypoints in the other layouts.

        Args:
            rows: waypoints in the first layout, (N, 6) or (N, 7).
            anchors: what each stands by.
        """
        if not self.several:
            return []

        written = self._writer.write(rows, anchors)
        plan = self._brief.actions.parse(written, gripper=self._brief.gripper)
        return [plan.resolve(layout.seen).poses for layout in self._layouts[1:]]

    def count(
        self,
        tool: Tool,
        plan: SampledPlan,
        subgoals: Sequence[Subgoal],
        enough: float = np.inf,
    ) -> float:
        """Count the faults of a plan; 0: it has none.

        A plan without any in the first layout gets at most 1: the less, the later the first layout with some comes.

        Args:
            tool: what carries the plan out.
            plan: in the first layout.
            subgoals: what it is for; their bodies and containers may be touched where the plan says so.
            enough: above 0. Counting ends where the plan has as many; then the result is at least this.
        """
        moved = names_moved(subgoals)
        here = self._layouts[0]
        fault = self._count_in(
            here, tool, plan, plan.rows, moved, enough - self.several
        )
        if fault > 0.0:
            return fault + self.several

        elsewhere = self.resolve_elsewhere(plan.rows, plan.anchors)
        for number, rows in enumerate(elsewhere):
            layout = self._layouts[number + 1]
            if self._count_in(layout, tool, plan, rows, moved) > 0.0:
                return 1.0 - number / len(elsewhere)

        return 0.0

    def _count_in(
        self,
        layout: Layout,
        tool: Tool,
        plan: SampledPlan,
        rows: Array,
        moved: set[str],
        enough: float = np.inf,
    ) -> float:
        """Count faults in one layout.

        Args:
            layout: where the plan is tried.
            tool: what carries it out.
            plan: as it was sampled.
            rows: its waypoints in this layout.
            moved: the names of bodies that the head may touch where the plan says so.
            enough: where counting ends.
        """
        boxes = tool_boxes(tool)
        if tool.gripper:
            boxes = Boxes.concatenate([boxes, HAND])

        # The cheapest first: inverse kinematics takes longer.
        model = layout.analysis.world
        begin = np.concatenate([model.home.position, model.home.rpy])
        way = np.vstack([begin, rows[:, :6]])
        hits = count_collisions(model, boxes, way, plan.touching, moved)
        if hits > 0 and hits >= enough:
            return hits

        return self.count_arm(tool, rows, hits, enough)

    def count_arm(
        self, tool: Tool, rows: Array, hits: float, enough: float = np.inf
    ) -> float:
        """Add to a tool's collisions what is wrong with the arm's motion.

        Args:
            tool: what carries the plan out.
            rows: its waypoints, (N, 6) or (N, 7).
            hits: collisions that were counted.
            enough: where counting ends.
        """
        robot = self._brief.task.robot
        arm = arm_of(robot)
        hopeless = max(_MISS_M, (enough - hits) / _PER_METRE)
        miss = reach_error(rows, arm, hopeless)
        if miss > _MISS_M:
            fault = hits + _PER_METRE * miss
            return max(fault, enough) if miss > hopeless else fault

        home = self._layouts[0].analysis.world.home
        motion = plan_motion(Waypoints(rows), home, arm)
        if find_self_collision(robot, tool, motion.trajectory) is not None:
            return hits + BREAKS_RULES
        return hits


def names_moved(subgoals: Sequence[Subgoal]) -> set[str]:
    """Name the bodies of subgoals, and their loose containers."""
    names = set()
    for subgoal in subgoals:
        names |= {solid.body.name for solid in subgoal.solids}
        if subgoal.loose_container is not None:
            names.add(subgoal.loose_container.body.name)

    return names


def reach_error(rows: Array, arm: Arm, hopeless: float = np.inf) -> float:
    """Compute the worst error of inverse kinematics over the waypoints, in metres, and `_TURN_M` for a radian.

    Args:
        rows: waypoints, (N, 6) or (N, 7).
        arm: which goes from one to the next from its home.
        hopeless: the waypoints after a larger error than this are not looked at.
    """
    hopeless = min(hopeless, _HOPELESS_M)
    joints = arm.home
    worst = 0.0
    for row in rows:
        solution = arm.inverse(Pose.xyz_rpy(row[:3], row[3:6]), joints)
        joints = solution.joints
        worst = max(worst, solution.error_m + _TURN_M * solution.error_rad)
        if worst > hopeless:
            break

    return worst


def count_collisions(
    model: SceneModel,
    tool: Boxes,
    way: Array,
    touching: Sequence[bool],
    moved: set[str],
) -> int:
    """Count overlaps of a tool's boxes on the straight ways between waypoints.

    Those with the ``moved`` bodies count on ways where the head must not touch them.

    Args:
        model: which has the bodies.
        tool: boxes in the frame of the tool mount.
        way: where the motion begins, and N waypoints, (N + 1, 6) or more columns.
        touching: whether the tool may touch the moved bodies on the way to each waypoint, N.
        moved: names of bodies.
    """
    bodies = [solid.boxes for name, solid in model.solids.items() if name in moved]
    others = [solid.boxes for name, solid in model.solids.items() if name not in moved]
    count = count_on_way(tool, way, Boxes.concatenate(others))
    return count + count_on_way(tool, way, Boxes.concatenate(bodies), touching)


def count_on_way(
    tool: Boxes,
    way: Array,
    bodies: Boxes,
    touching: Sequence[bool] | None = None,
    step: float = _STEP_M,
) -> int:
    """Count overlaps of a tool's boxes with others on the straight ways between waypoints.

    Args:
        tool: boxes in the frame of the tool mount.
        way: N + 1 waypoints, (N + 1, 6) or more columns.
        bodies: the other boxes, in the world.
        touching: on which of the N ways they do not count; None: on none.
        step: between two places that are checked, at most, metres.
    """
    positions, rotations, numbers = _sample_way(way[:, :6], step)
    if touching is not None:
        forbidden = ~np.array(touching, dtype=bool)[numbers]
        positions = positions[forbidden]
        rotations = rotations[forbidden]

    boxes = tool.moved_to(positions, rotations)
    return count_overlaps(boxes, bodies, margin=-_CONTACT_M)


def _sample_way(way: Array, step: float) -> tuple[Array, Array, npt.NDArray[np.int64]]:
    """Sample the straight ways between poses at both ends, and at least every ``step``.

    Args:
        way: N + 1 poses as x, y, z, roll, pitch and yaw.
        step: metres.

    Returns:
        Positions (K, 3), rotations (K, 3, 3), and the number of the way that each is on (K,).
    """
    steps = np.diff(way[:, :3], axis=0)
    counts = np.maximum(2, np.ceil(step_lengths(way[:, :3]) / step).astype(int) + 1)
    numbers = np.repeat(np.arange(len(steps), dtype=np.int64), counts)
    shares = np.concatenate([np.linspace(0.0, 1.0, count) for count in counts])
    share = shares[:, None]
    positions = way[numbers, :3] + share * steps[numbers]

    turns = Rotation.from_euler("xyz", way[:, 3:6])
    between = (turns[:-1].inv() * turns[1:]).as_rotvec()
    turned = turns[numbers] * Rotation.from_rotvec(between[numbers] * share)

    return positions, turned.as_matrix(), numbers
