"""Invent a fresh tool and plans for a scene: sample several, and keep the one with the fewest faults."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import DesignError, Tool
from core.designs.planning import look
from core.designs.rules import check_tool
from core.designs.start import SpawnRules
from core.geometry import Array, Pose
from core.interfaces import PAPER, Anchor, Brief, Perception, Seen, Waypoints
from core.robot.kinematics import arm_of
from core.robot.trajectory import plan_motion
from core.solids.self_collision import find_self_collision
from plugins.vlms.offline.boxes import Boxes
from plugins.vlms.offline.guided import guided, handles, pourer, suits
from plugins.vlms.offline.heads import Head, sample_clamp, sample_head
from plugins.vlms.offline.plans import Path, anchors_of, collisions, reach_error
from plugins.vlms.offline.primitives import PRIMITIVES
from plugins.vlms.offline.scene_analysis import SceneAnalysis, Subgoal
from plugins.vlms.offline.tools import (
    HAND,
    STYLES,
    build,
    build_clamp,
    recognize,
    sample_turn,
    tool_boxes,
)

_DIGITS = 5  # hundredths of a millimetre
_ANCHORING = 1  # keeps its random numbers apart from others of the same seed
_TOOL_TRIES = 12
_PLAN_TRIES = 5
_MOST_TRIES = 60
_MOUNTS = 40  # end-effector positions that are compared,
_MORE = 2  # times as many where a tool must do in several layouts
_MISS_M = 0.005  # error of inverse kinematics that is not a fault
_BREAKS_RULES = 1000.0
_ALONE = 0.8  # how often scattered bodies are moved one by one where a plan must do in several layouts
_GUIDED = 0.85  # how often a guided way is chosen where one suits
_HAND_M = 0.068  # the hand's height
_LOW_M = 0.05  # a tool that is less high over the ground works there
_BEYOND_M = 0.012  # how far below the ground a touch is looked for
_TOUCH_MPS = 0.05

A = TypeVar("A")
FindHead = Callable[[Subgoal], tuple[Head, Pose]]


class SampledPlan(NamedTuple):
    """A plan: its waypoints as rows, what it does in words, and what each waypoint stands by.

    ``touching`` marks the waypoints on the way to which the head may touch the bodies.
    """

    rows: Array
    text: str
    anchors: Sequence[Anchor]
    touching: Sequence[bool] = ()


class Aim(NamedTuple):
    """Which way a head points from the mount, radians, and how far below it its foot is, metres."""

    turn: float
    drop: float


class Layout:
    """A layout of the task: its analysis, the poses that a plan sees of it, and the rules for tools in it.

    With a ``turn``, analysis and poses are moved by it.
    """

    def __init__(self, brief: Brief, turn: Pose | None = None) -> None:
        """Read a brief.

        Raises:
            NothingToMove: see `SceneAnalysis`.
        """
        seen = look(brief.task, brief.scene_seed, Perception()).poses
        self.seen = Seen(
            seen if turn is None else {name: turn @ pose for name, pose in seen.items()}
        )
        self.analysis = SceneAnalysis(brief, turn)
        self.spawn = SpawnRules(brief.task, brief.scene_seed)


class Sampler:
    """Samples tools and plans for a brief's layout, and keeps those with the fewest faults.

    A plan must do in ``others`` too; ``aim`` is where heads are.
    """

    def __init__(
        self,
        brief: Brief,
        layout: Layout,
        others: Sequence[Layout] = (),
        aim: Aim | None = None,
    ) -> None:
        self.brief = brief
        self.layouts = (layout, *others)
        self.analysis = layout.analysis
        self.rng = np.random.default_rng(brief.seed)
        self._anchoring = np.random.default_rng([brief.seed, _ANCHORING])
        self._aim = aim
        self._several = bool(others)
        self._guides: bool | None = (
            None  # whether the tool at hand goes a guided way, where there is one
        )

    @property
    def stout(self) -> float:
        """How many times as thick as of the stiff default material parts are, so that they bend little enough."""
        return float(
            max(
                1.0,
                (PAPER.young_pa / self.brief.representation.material.young_pa) ** 0.125,
            )
        )

    @property
    def room(self) -> float:
        """The height of the end-effector's home over the highest body below it, metres."""
        tops = self.analysis.boxes.bounds[1][:, 2]
        home = float(self.analysis.home.position[2])
        return home - float(tops[tops < home].max(initial=-np.inf))

    def accepts(self, tool: Tool) -> bool:
        """Report whether the tool keeps the rules."""
        material = self.brief.representation.material
        try:
            check_tool(material.made(tool), self.brief.task.robot, material)
            for layout in self.layouts:
                layout.spawn.check(tool)
        except DesignError:
            return False
        return True

    def written(self, rows: Array, anchors: Sequence[Anchor]) -> list[Any]:
        """A plan as in a designs document."""
        return self.brief.actions.anchor(
            Waypoints(np.round(rows, _DIGITS) + 0.0), anchors, self.layouts[0].seen
        )

    def written_with_guard(self, plan: SampledPlan, tool: Tool) -> list[Any]:
        """Write a plan that touches the ground where its tool is low for the first time, and corrects heights by that.

        It is written as it is if the tool stays high, or if its waypoints stand by no body.
        """
        names = sorted(
            {anchor.name for anchor in plan.anchors} & {*self.layouts[0].seen.poses}
        )
        goals = {name for goal in self.analysis.goals for name in goal.bodies}
        ground = min(
            float(self.analysis.solids[name].points[:, 2].min()) for name in goals
        )
        turns = Rotation.from_euler("xyz", plan.rows[:, 3:6]).as_matrix()
        bottoms = tool_boxes(tool).carried(plan.rows[:, :3], turns).bounds[0][:, 2]
        over = (
            bottoms.reshape(len(turns), len(tool.components)).min(
                axis=1, initial=np.inf
            )
            - ground
        )
        low = np.flatnonzero((over > -_BEYOND_M) & (over < _LOW_M))
        if not names or not len(low):
            return self.written(plan.rows, plan.anchors)
        first = int(low[0])
        order = [
            *range(first + 1),
            first,
            *range(first, len(plan.rows)),
        ]  # there, down, and up again
        rows = plan.rows[order]
        rows[first + 1, 2] -= over[first] + _BEYOND_M
        steps = self.written(rows, [plan.anchors[i] for i in order])
        steps[first + 1] |= {
            "until": "touch",
            "speed": _TOUCH_MPS,
            "corrects": names,
            "beyond": _BEYOND_M,
        }
        return steps

    def _elsewhere(self, rows: Array, anchors: Sequence[Anchor]) -> list[Array]:
        """What becomes of a plan in the other layouts."""
        if not self._several:
            return []
        plan = self.brief.actions.parse(
            self.written(rows, anchors), gripper=self.brief.gripper
        )
        return [plan.resolve(layout.seen).poses for layout in self.layouts[1:]]

    def invent(self) -> tuple[Tool, Head, Pose, SampledPlan]:
        """A fresh tool, its head, the head's pose in the frame of the tool mount, and a first plan.

        It is the best of a random number of samples: doubtful ones are not always the worst.
        """
        self._guides = None
        return _least_faulty(
            self._invent_once, int(self.rng.integers(2, _TOOL_TRIES + 1))
        )

    def use(self, tool: Tool, find_head: FindHead) -> SampledPlan:
        """A plan for a tool; ``find_head`` returns its head and the head's pose for a subgoal."""
        return _least_faulty(lambda: self._use_once(tool, find_head), _PLAN_TRIES)

    def use_any(self, tool: Tool) -> SampledPlan:
        """A plan for a tool of any origin, whose foot is taken for its head."""
        return self.use(tool, lambda subgoal: recognize(tool, subgoal, self.rng))

    def _use_once(self, tool: Tool, find_head: FindHead) -> tuple[SampledPlan, float]:
        subgoals = self._subgoals()
        head, pose = find_head(subgoals[0])
        return self._plan(tool, pose, self._path(subgoals, head), subgoals)

    def fault(self, tool: Tool) -> float:
        """The least fault of some plans for a tool of any origin; 0: one has none."""
        least = np.inf
        for _ in range(_PLAN_TRIES):
            _, fault = self._use_once(
                tool, lambda subgoal: recognize(tool, subgoal, self.rng)
            )
            least = min(least, fault)
            if least == 0.0:
                break
        return least

    def _invent_once(self) -> tuple[tuple[Tool, Head, Pose, SampledPlan], float]:
        subgoals = self._subgoals()
        largest = max(subgoals, key=lambda subgoal: len(subgoal.solids))
        head = self._head(largest)
        path = self._path(subgoals, head)
        pose = self._mount(path, head, largest) if head.pose is None else head.pose
        tool = self._build(head, pose, path, largest)
        plan, fault = self._plan(tool, pose, path, subgoals)
        return (tool, head, pose, plan), fault + (
            0.0 if self.accepts(tool) else _BREAKS_RULES
        )

    def _head(self, subgoal: Subgoal) -> Head:
        rng = self.rng
        if self.brief.gripper:
            clamps = rng.random() < (
                0.9 if subgoal.deep and subgoal.shift[2] > 0.03 else 0.5
            )
            return (
                sample_clamp(subgoal, rng)
                if clamps
                else sample_head(subgoal, rng, self.stout)
            )
        if suits(subgoal):
            if self._guides is None:
                self._guides = bool(rng.random() < _GUIDED)
            if self._guides and (head := guided(subgoal, rng)) is not None:
                return head
        grips = handles(subgoal)
        if grips is not None and rng.random() < 0.8:
            return pourer(subgoal, grips, rng, self.stout)
        return sample_head(subgoal, rng, self.stout)

    def _build(self, head: Head, pose: Pose, path: Path, subgoal: Subgoal) -> Tool:
        if head.pose is not None:
            return build(head, pose, "none", 0.01, False)
        rng = self.rng
        thickness = self.stout * float(rng.uniform(0.012, 0.024))
        style = list(STYLES)[int(rng.choice(len(STYLES), p=[0.6, 0.2, 0.2, 0.0]))]
        if head.use == "clamp":
            return build_clamp(
                head, pose, min(thickness, 0.012) if subgoal.deep else thickness
            )
        if not self._is_high(path):
            return build(head, pose, style, thickness, self.brief.gripper)
        # The jib passes over the bodies.
        top = float(
            pose.position[2]
            + max(subgoal.tall + thickness, head.hold[2])
            + rng.uniform(0.01, 0.06)
        )
        bend = float(rng.uniform(0.25, 0.6))
        return build(
            head, pose, "riser", thickness, self.brief.gripper, bend=bend, top=top
        )

    def _subgoals(self) -> list[Subgoal]:
        return self.analysis.subgoals(
            self.rng, alone=self._several and self.rng.random() < _ALONE
        )

    def _path(self, subgoals: Sequence[Subgoal], head: Head) -> Path:
        """The head's path through all subgoals; a head with its own primitive has one for all of them."""
        path = Path()
        if head.primitive is not None:
            path.texts.append(head.primitive(path, self.rng))
            path.end()
        else:
            for subgoal in subgoals:
                path.texts.append(PRIMITIVES[head.use](path, subgoal, head, self.rng))
                path.end()
        path.anchors = anchors_of(path, subgoals, self._anchoring)
        return path

    def _plan(
        self, tool: Tool, pose: Pose, path: Path, subgoals: Sequence[Subgoal]
    ) -> tuple[SampledPlan, float]:
        """The plan that moves the head at a pose along the path, and its fault; for a high path it may rise before."""
        text = "; then ".join(dict.fromkeys(path.texts))
        plan = SampledPlan(
            path.plan(pose, tool.gripper), text, path.anchors, path.touching
        )
        fault = self._fault(tool, plan, subgoals)
        if fault <= self._several or not self._is_high(path):  # none in this layout
            return plan, fault
        options = [(fault, plan)]
        space = self.analysis.space
        home = self.analysis.home.position
        outward = space.from_axis(plan.rows[0])
        for radius in (
            np.hypot(*space.from_axis(home)),
            round(space.inner + 0.1, 2),
            space.inner,
        ):
            ahead = np.repeat(plan.rows[:1], 2, axis=0)
            ahead[:, :2] = space.base[:2] + outward * (
                radius / max(np.hypot(*outward), 1e-6)
            )
            ahead[0, 2] = home[2]
            longer = plan._replace(
                rows=np.vstack([ahead, plan.rows]),
                anchors=[Anchor()] * 2 + path.anchors,
                touching=[False] * 2 + path.touching,
            )
            options.append((self._fault(tool, longer, subgoals), longer))
        fault, plan = min(options, key=lambda option: option[0])
        return plan, fault

    def _is_high(self, path: Path) -> bool:
        """Report whether the head works higher than the end-effector's home."""
        return path.lowest > float(self.analysis.home.position[2])

    def _fault(
        self, tool: Tool, plan: SampledPlan, subgoals: Sequence[Subgoal]
    ) -> float:
        """A measure of unwanted collisions and missed waypoints; 0: there are none.

        A plan without any in this layout gets at most 1: the less, the later the first layout with some comes.
        """
        solids = [
            solid for subgoal in subgoals for solid in (*subgoal.solids, subgoal.holder)
        ]
        moved = {solid.body.name for solid in solids if solid}
        fault = self._fault_in(self.analysis, tool, plan.rows, plan.touching, moved)
        if fault > 0.0:
            return fault + self._several
        elsewhere = self._elsewhere(plan.rows, plan.anchors)
        for number, rows in enumerate(elsewhere):
            if (
                self._fault_in(
                    self.layouts[number + 1].analysis, tool, rows, plan.touching, moved
                )
                > 0.0
            ):
                return 1.0 - number / len(elsewhere)
        return 0.0

    def _fault_in(
        self,
        analysis: SceneAnalysis,
        tool: Tool,
        rows: Array,
        touching: Sequence[bool],
        moved: set[str],
    ) -> float:
        bodies = Boxes.join(
            solid.boxes for name, solid in analysis.solids.items() if name in moved
        )
        others = Boxes.join(
            solid.boxes for name, solid in analysis.solids.items() if name not in moved
        )
        parts = (
            Boxes.join([tool_boxes(tool), HAND]) if tool.gripper else tool_boxes(tool)
        )
        hits = collisions(rows, touching, parts, analysis.home, bodies, others)
        robot = self.brief.task.robot
        arm = arm_of(robot)
        miss = reach_error(rows, arm)
        if miss > _MISS_M:
            return hits + 100.0 * miss
        meets_itself = find_self_collision(
            robot, tool, plan_motion(rows, self.analysis.home, arm).trajectory
        )
        return hits + (0.0 if meets_itself is None else _BREAKS_RULES)

    def _mount(self, path: Path, head: Head, subgoal: Subgoal) -> Pose:
        """The head's pose in the frame of the tool mount that keeps the arm in its comfortable workspace."""
        rng = self.rng
        space = self.analysis.space
        home = self.analysis.home.position
        start = path.poses[1]
        yaw = sample_turn(rng) + rng.normal(0.0, 0.15) * (rng.random() < 0.5)
        if head.use == "clamp":
            yaw = float(start.rpy[2])
        elif self._aim is not None and not self._is_high(path):
            yaw = self._aim.turn
        least, most = self._drops(path, head, subgoal)
        straight = head.use == "clamp" and subgoal.deep

        rows = path.plan(Pose(), self.brief.gripper)
        plans = [rows, *self._elsewhere(rows, path.anchors)]
        motions = [
            (plan[:, :3], Rotation.from_euler("xyz", plan[:, 3:6]).as_matrix())
            for plan in plans
        ]
        ahead = space.direction(home) if space.base[:2].any() else 0.0
        poses: list[tuple[float, Pose]] = []
        for _ in range(_MOUNTS * (_MORE if self._several else 1)):
            angle = ahead + rng.uniform(-0.9, 0.9)
            radius = rng.uniform(space.inner + 0.02, space.outer - 0.02)
            height = start.position[2] + rng.uniform(least, most)
            flat = space.base[:2] + radius * np.array([np.cos(angle), np.sin(angle)])
            x, y = start.position[:2] if straight else flat
            pose = Pose.xyz_rpy((x, y, height), (0.0, 0.0, yaw)).inverse() @ start
            back = pose.inverse().position
            strain = sum(space.strain(heads + turns @ back) for heads, turns in motions)
            cost = 20.0 * strain + np.hypot(*pose.position[:2]) + rng.uniform(0.0, 0.15)
            poses.append((cost, pose))
        return min(poses, key=lambda option: option[0])[1]

    def _drops(self, path: Path, head: Head, subgoal: Subgoal) -> tuple[float, float]:
        """The least and the greatest height of the tool mount over the head, metres.

        It is low enough for the shaft above the head, and high enough that the head at home is clear of the scene.
        """
        top = (
            head.hold
            if head.primitive is None
            else path.poses[1].rotation.apply(head.hold)
        )
        least = float(top[2]) + (0.18 if self.brief.gripper else 0.03)
        room = min(self.room, float(self.analysis.home.position[2]) - path.lowest)
        most = max(least + 0.02, min(room - 0.015, 0.45))
        if self._is_high(path):
            least = -0.45
            most = 0.0
        elif self._aim is not None:
            least = most = max(least, self._aim.drop)
        if (
            head.use == "clamp" and subgoal.deep
        ):  # the hand stays above the container that the fingers reach into
            most = max(least, room - 0.003)
            least = min(most, subgoal.clear_z - path.lowest + _HAND_M)
        return least, most


def _least_faulty(make: Callable[[], tuple[A, float]], tries: int) -> A:
    """The first result without fault, or the least faulty of ``tries``; more tries while none keeps the rules."""
    best, least = make()
    for count in range(1, _MOST_TRIES):
        if least == 0.0 or (count >= tries and least < _BREAKS_RULES):
            break
        other, fault = make()
        if fault < least:
            best = other
            least = fault
    return best
