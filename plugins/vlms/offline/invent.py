"""Invent a fresh tool and plans for a scene: sample several, and keep the one with the fewest faults."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import DesignError, Tool
from core.designs.rules import SpawnRules, check_tool
from core.geometry import Array, Pose
from core.interfaces import PAPER, ActionPlan, Anchor, Material, Seen, Waypoints
from core.robot.kinematics import arm_of
from plugins.vlms.offline.anchoring import anchors_of
from plugins.vlms.offline.boxes import Boxes
from plugins.vlms.offline.clamps import build_clamp, sample_clamp
from plugins.vlms.offline.guided import guided, suits
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.pinch import sample_pinch
from plugins.vlms.offline.plans import Path, collisions, meets_itself, reach_error
from plugins.vlms.offline.pour import AT, build_fork, handles, sample_fork
from plugins.vlms.offline.scene_analysis import Errand, Sight
from plugins.vlms.offline.sizing import sample_head
from plugins.vlms.offline.strokes import head_path
from plugins.vlms.offline.tools import HAND, STYLES, build, tool_boxes

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

A = TypeVar("A")


@dataclass(frozen=True, eq=False)
class Use:
    """A plan, its description, and what each waypoint stands by."""

    plan: Array
    text: str
    anchors: Sequence[Anchor]


@dataclass(eq=False)
class Workshop:
    """Invents tools and plans for one scene, and for those ``elsewhere``: ``read`` makes a plan for all."""

    sight: Sight
    seen: Seen
    spawn: SpawnRules
    gripper: bool
    rng: np.random.Generator
    anchoring: np.random.Generator
    material: Material = PAPER
    elsewhere: Sequence[tuple[Sight, Seen, SpawnRules]] = ()
    read: Callable[[Array, Sequence[Anchor]], ActionPlan] = lambda rows, _: Waypoints(rows)
    _guides: bool | None = None  # whether the tool at hand goes a guided way, where there is one

    @property
    def stout(self) -> float:
        """How many times as thick as of the stiff default material parts are, so that they bend little enough."""
        return float(max(1.0, (PAPER.young_pa / self.material.young_pa) ** 0.125))

    def accepts(self, tool: Tool) -> bool:
        """Report whether the tool keeps the rules."""
        try:
            check_tool(self.material.made(tool), self.spawn.robot, self.material)
            for spawn in (self.spawn, *(spawn for _, _, spawn in self.elsewhere)):
                spawn.check(tool)
        except DesignError:
            return False
        return True

    def invent(self) -> tuple[Tool, Head, Pose, Use]:
        """A fresh tool, its head, the head's pose in the frame of the tool mount, and a first use.

        It is the best of a random number of samples: doubtful ones are not always the worst.
        """
        self._guides = None
        return _least_faulty(self._invent_once, int(self.rng.integers(2, _TOOL_TRIES + 1)))

    def use(self, tool: Tool, find_head: Callable[[Errand], tuple[Head, Pose]]) -> Use:
        """A plan for a tool; ``find_head`` returns its head and the head's pose for an errand."""
        return _least_faulty(lambda: self._use_once(tool, find_head), _PLAN_TRIES)

    def _invent_once(self) -> tuple[tuple[Tool, Head, Pose, Use], float]:
        errands = self._errands()
        largest = max(errands, key=lambda errand: len(errand.things))
        head = self._head(largest)
        path, text = self._path(errands, head)
        at = AT if head.use == "pour" else self._mount(path, head, largest)
        tool = self._build(head, at, path, largest)
        use, fault = self._planned(tool, at, path, text, errands)
        return (tool, head, at, use), fault + (0.0 if self.accepts(tool) else _BREAKS_RULES)

    def _head(self, errand: Errand) -> Head:
        if not self.gripper and suits(errand):
            if self._guides is None:
                self._guides = bool(self.rng.random() < _GUIDED)
            if self._guides and (head := guided(errand, self.rng)) is not None:
                return head
        holder = errand.holder
        grips = handles(holder, errand.space) if holder is not None and not self.gripper else None
        if grips is not None and self.rng.random() < 0.8:
            return sample_fork(grips, self.rng, self.stout)
        lifts = errand.deep and errand.shift[2] > 0.03
        if lifts and self.spawn.robot.gripper is None and self.rng.random() < 0.8:
            return sample_pinch(errand, self.rng)
        clamps = self.gripper and self.rng.random() < (0.9 if lifts else 0.5)
        return sample_clamp(errand, self.rng) if clamps else sample_head(errand, self.rng, self.stout)

    def _build(self, head: Head, at: Pose, path: Path, errand: Errand) -> Tool:
        if head.use == "pour":
            return build_fork(head)
        thickness = self.stout * float(self.rng.uniform(0.012, 0.024))
        style = STYLES[int(self.rng.choice(len(STYLES), p=[0.6, 0.2, 0.2, 0.0]))]
        if head.use == "clamp":
            return build_clamp(head, at, min(thickness, 0.012) if errand.deep else thickness)
        if head.use == "pinch":
            return build(head, at, "gantry", min(thickness, 0.012), self.gripper)
        if not self._is_high(path):
            return build(head, at, style, thickness, self.gripper)
        tall = float(errand.upper[2] - errand.lower[2])  # the jib passes over the bodies
        top = float(at.position[2] + max(tall + thickness, head.hold[2]) + self.rng.uniform(0.01, 0.06))
        bend = float(self.rng.uniform(0.25, 0.6))
        return build(head, at, "riser", thickness, self.gripper, bend=bend, top=top)

    def _use_once(self, tool: Tool, find_head: Callable[[Errand], tuple[Head, Pose]]) -> tuple[Use, float]:
        errands = self._errands()
        head, at = find_head(errands[0])
        path, text = self._path(errands, head)
        return self._planned(tool, at, path, text, errands)

    def _errands(self) -> list[Errand]:
        return self.sight.errands(self.rng, alone=bool(self.elsewhere) and self.rng.random() < _ALONE)

    def _path(self, errands: Sequence[Errand], head: Head) -> tuple[Path, str]:
        path, text = head_path(errands, head, self.rng)
        path.anchors = anchors_of(path, errands, self.sight, self.anchoring)
        return path, text

    def _planned(self, tool: Tool, at: Pose, path: Path, text: str, errands: Sequence[Errand]) -> tuple[Use, float]:
        """The plan that moves the head at the pose ``at`` along the path, and its fault. For a high path it may first
        rise at a distance.
        """
        plan, touching, home = path.plan(at, tool.gripper), list(path.touching), self.sight.home.position
        anchors = path.anchors
        fault = self._fault(tool, plan, anchors, touching, errands)
        if fault <= float(bool(self.elsewhere)) or not self._is_high(path):  # none in this layout
            return Use(plan, text, anchors), fault
        tried = [(fault, plan)]
        space = self.sight.space
        way = space.from_axis(plan[0])
        anchors = [Anchor()] * 2 + anchors
        for radius in (float(np.hypot(*space.from_axis(home))), round(space.inner + 0.1, 2), space.inner):
            rows = np.repeat(plan[:1], 2, axis=0)
            rows[:, :2] = space.base[:2] + way * (radius / max(float(np.hypot(*way)), 1e-6))
            rows[0, 2] = home[2]
            longer = np.vstack([rows, plan])
            tried.append((self._fault(tool, longer, anchors, [False, False, *touching], errands), longer))
        fault, plan = min(tried, key=lambda one: one[0])
        return Use(plan, text, anchors[len(anchors) - len(plan) :]), fault

    def _is_high(self, path: Path) -> bool:
        """Report whether the head works higher than the end-effector's home."""
        return bool(min(pose.position[2] for pose in path.poses) > self.sight.home.position[2])

    def _fault(
        self, tool: Tool, plan: Array, anchors: Sequence[Anchor], touching: Sequence[bool], errands: Sequence[Errand]
    ) -> float:
        """A measure of unwanted collisions and missed waypoints; 0: there are none.

        A plan without any in this layout gets at most 1: the less, the later the first layout with some comes.
        """
        moved = {self.sight.name(thing) for errand in errands for thing in (*errand.things, errand.holder) if thing}
        fault = self._fault_in(self.sight, tool, plan, touching, moved)
        if fault > 0.0 or not self.elsewhere:
            return fault + float(fault > 0.0 and bool(self.elsewhere))
        read = self.read(plan, anchors)
        for number, (sight, seen, _) in enumerate(self.elsewhere):
            if self._fault_in(sight, tool, read.resolve(seen).poses, touching, moved) > 0.0:
                return 1.0 - number / len(self.elsewhere)
        return 0.0

    def _fault_in(self, sight: Sight, tool: Tool, plan: Array, touching: Sequence[bool], moved: set[str]) -> float:
        pairs = list(zip(sight.names, sight.things, strict=True))
        others = Boxes.join(thing.boxes for name, thing in pairs if name not in moved)
        wanted = Boxes.join(thing.boxes for name, thing in pairs if name in moved)
        solids = Boxes.join([tool_boxes(tool), HAND]) if tool.gripper else tool_boxes(tool)
        hits = collisions(plan, touching, solids, sight.home, wanted, others)
        arm = arm_of(self.spawn.robot)
        miss = reach_error(plan, arm)
        if miss > _MISS_M:
            return hits + 100.0 * miss
        return hits + (_BREAKS_RULES if meets_itself(tool, plan, self.sight.home, arm) else 0.0)

    def _mount(self, path: Path, head: Head, errand: Errand) -> Pose:
        """The head's pose in the frame of the tool mount that keeps the arm in its comfortable workspace."""
        rng, home = self.rng, self.sight.home.position
        start = path.poses[1]
        turn = float(rng.choice([0.0, np.pi / 4, -np.pi / 4, np.pi / 2, -np.pi / 2], p=[0.6, 0.1, 0.1, 0.1, 0.1]))
        yaw = turn + rng.normal(0.0, 0.15) * (rng.random() < 0.5)
        if head.use in ("clamp", "pinch"):
            yaw = float(start.rpy[2])
        # Low enough for the shaft above the head, and high enough that the head at home is clear of the scene.
        top = head.hold if head.way is None else start.rotation.apply(head.hold)
        least = float(top[2]) + (0.18 if self.gripper else 0.03)
        tops = self.sight.boxes.upper[:, 2]
        beneath = float(tops[tops < home[2]].max(initial=min(pose.position[2] for pose in path.poses)))
        most = max(least + 0.02, min(home[2] - beneath - 0.015, 0.45))
        if self._is_high(path):
            least, most = -0.45, 0.0
        straight = head.use in ("clamp", "pinch") and errand.deep
        if straight:  # the hand stays above the container that the fingers reach into
            lowest = min(pose.position[2] for pose in path.poses)
            most = max(least, home[2] - beneath - 0.003)
            least = min(most, errand.clear_z - lowest + (_HAND_M if self.gripper else 0.005))
        rows = path.plan(Pose(), self.gripper)
        read = self.read(rows, path.anchors)
        found = [rows, *(read.resolve(seen).poses for _, seen, _ in self.elsewhere)]
        ways = [(rows[:, :3], Rotation.from_euler("xyz", rows[:, 3:6]).as_matrix()) for rows in found]
        space = self.sight.space
        ahead = space.direction(home) if space.base[:2].any() else 0.0
        places: list[tuple[float, Pose]] = []
        for _ in range(_MOUNTS * (_MORE if self.elsewhere else 1)):
            angle = ahead + rng.uniform(-0.9, 0.9)
            radius, drop = rng.uniform(space.inner + 0.02, space.outer - 0.02), rng.uniform(least, most)
            way = radius * np.array([np.cos(angle), np.sin(angle)])
            place = (*(space.base[:2] + way), start.position[2] + drop)
            if straight:
                place = (start.position[0], start.position[1], start.position[2] + drop)
            at = Pose.xyz_rpy(place, (0.0, 0.0, yaw)).inverse() @ start
            back = at.inverse()
            strain = sum(space.strain(heads + turns @ back.position) for heads, turns in ways)
            cost = 20.0 * strain + float(np.hypot(*at.position[:2])) + rng.uniform(0.0, 0.15)
            places.append((cost, at))
        return min(places, key=lambda place: place[0])[1]


def _least_faulty(make: Callable[[], tuple[A, float]], tries: int) -> A:
    """The first result without fault, or the least faulty of ``tries``; more tries while none keeps the rules."""
    best, least = make()
    for count in range(1, _MOST_TRIES):
        if least == 0.0 or (count >= tries and least < _BREAKS_RULES):
            break
        other, fault = make()
        if fault < least:
            best, least = other, fault
    return best
