"""Hold bodies by the grips of a tool in a world that is stepped: from a touch with the whole patch to too much load.

A body hangs from a patch by three springs, whose forces are applied in each step. They give way by some tenths of a
millimetre, as a cup or a pad does. If they were rigid, an arm that presses a body onto a table by as much would shear
and tilt it with a hundred newtons. Tool and body don't collide meanwhile, so that the springs bear all that there is.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections import deque
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from core.design import Tool
from core.geometry import Array, Pose, Sphere
from core.interfaces import Robot, World
from core.robot.description import assembled
from core.robot.kinematics import link_frames
from core.robot.solids import Solid, body_solids, closest, solid_geometry
from core.scene import Body, Scene, State
from core.values.grips import TOUCH_M, Grip, Gripped, Limit, Load
from core.values.jobs import FEEL_S
from plugins.simulators.inertia import Inertia, inertia_of

# A load counts as its mean over this time, s: engines have different steps, and a cup's rubber gives way meanwhile.
_MEAN_S = 0.1
# A body that slipped or broke off is not taken hold of again before it was so far away, m.
_AWAY_M = 0.005
# A patch that comes nearer by more than this between two looks, m, does not hold yet: it would push the body on.
_SLOW_M = 1e-5
_POINT_M = 1e-4  # radius of the ball by which a gap is measured
# A spring swings by so many radians in a step; with 1 and more it is not stable.
_SWINGS = 0.7
_DAMPING = 0.5  # as a share of the critical one
_ARM_KG = (
    0.5  # of the arm, as felt at its end: a careful guess, by which springs stay stable
)
_TURNS = np.arange(3) * 2 * math.pi / 3
_AROUND = np.column_stack([np.cos(_TURNS), np.sin(_TURNS), np.zeros(3)])
_PROBE = solid_geometry(Sphere(_POINT_M))


@dataclass(eq=False)
class Face:
    """A component's face that grips, and what it does.

    Attributes:
        component: its name.
        grip: its kind.
        bearer: the link that bears it.
        pose: of the patch in that link's frame.
        body: what it holds; empty: nothing.
        begun_s: since when.
        hardest: the largest share of a limit since then.
        lost: what it lost, or touched in vain, and is still near.
        gap: the mean of the last gaps that were measured, m.
        forces: of the springs in the last steps, each (3, 3), N.
        springs: that hold the body.
    """

    component: str
    grip: Grip
    bearer: str
    pose: Pose
    body: str = ""
    begun_s: float = 0.0
    hardest: Limit | None = None
    lost: str = ""
    gap: float = math.inf
    forces: deque[Array] = field(default_factory=deque)
    springs: _Springs | None = None


@dataclass(eq=False)
class _Springs:
    """What holds a body.

    Attributes:
        anchors: where they hang, in the patch's frame (3, 3), m; farther out than the patch where they may turn.
        points: at which they hold the body, in its own frame (3, 3), m.
        stiffness: of each spring, N/m.
        damping: N s/m.
        lengths: after the last step (3, 3), m, in the world.
    """

    anchors: Array
    points: Array
    stiffness: float
    damping: float
    lengths: Array


@dataclass(frozen=True, eq=False)
class _Target:
    """A body that can be held: its solids in its frame, and how far they reach from its origin, m."""

    body: Body
    solids: tuple[Solid, ...]
    reach: float


class Grips(ABC):
    """The grips of the tool in a world. An engine's class says how it pushes.

    Call `launch` when the motion begins, and `end_step` after each step.

    Args:
        robot: the arm.
        tool: with components that grip.
        scene: has the bodies.
        time_step: of the world, s.

    Attributes:
        faces: those that grip.
    """

    def __init__(
        self, robot: Robot, tool: Tool, scene: Scene, time_step: float
    ) -> None:
        self._robot = robot
        self._tool = tool
        self._time_step = time_step
        self._kept = max(1, round(_MEAN_S / time_step))
        self._tick = max(1, round(FEEL_S / time_step))
        self._steps = -1  # since the motion began; below 0: it did not
        self._done: list[Gripped] = []
        self.faces = []
        for component in tool.gripping:
            assert component.grips is not None
            bearer, pose = tool.borne[component.name]
            patch = pose @ component.grips.place(component.shape)
            face = Face(component.name, component.grips, bearer, patch)
            face.forces = deque(maxlen=self._kept)
            self.faces.append(face)

        self._targets = [_aim_at(body) for body in scene.free if body.collisions]

    @abstractmethod
    def push(self, name: str, forces: Array, points: Array) -> None:
        """Push a body of the scene, or the link that bears the grips, in the next step.

        Args:
            name: of the body; empty: the link.
            forces: (3, 3) newtons, in the world.
            points: (3, 3) at which they act, in the world.
        """

    @abstractmethod
    def collide(self, name: str, *, collide: bool) -> None:
        """Let a body and the link that bears the grips collide, or not."""

    def rest(self) -> None:
        """Take away what was pushed with in the last step, for engines that go on pushing."""
        return

    @property
    def targets(self) -> list[str]:
        """The bodies that can be held, by name: those that can move, and do not bend."""
        return [target.body.name for target in self._targets]

    def launch(self) -> None:
        """Begin the motion."""
        self._steps = 0

    def end_step(self, world: World, fingers: float) -> None:
        """Take hold, and let go.

        Args:
            world: after the step.
            fingers: the target of the fingers, m: nearer to closed than to open, switched grips are on.
        """
        if self._steps < 0:
            return

        self._steps += 1
        self.rest()
        held = [face for face in self.faces if face.body]
        looking = self._steps % self._tick == 0
        if not held and not looking:
            return

        on = fingers < (self._robot.opening_m or 1.0) / 2
        state = world.state()
        for face, place in zip(self.faces, self._place(world), strict=True):
            if face.body:
                self._bear(face, place, state, on)
            elif looking:
                self._look(face, place, state, on)

    def save(self) -> Any:
        """Return what the grips do and did."""
        return deepcopy((self._steps, self._done, self.faces))

    def restore(self, saved: Any) -> None:
        """Go back to what was saved."""
        self._steps, self._done, self.faces = deepcopy(saved)
        held = {face.body for face in self.faces}
        for name in self.targets:
            self.collide(name, collide=name not in held)

    def report(self) -> tuple[Gripped, ...]:
        """Say what the grips did, in order of time; what is held is held to the end."""
        kept = [
            Gripped(
                face.component,
                face.grip.kind,
                face.body,
                face.begun_s,
                hardest=face.hardest or _NOTHING,
            )
            for face in self.faces
            if face.body
        ]
        return tuple(sorted([*self._done, *kept], key=lambda entry: entry.begin_s))

    @property
    def _now(self) -> float:
        return self._steps * self._time_step

    def _place(self, world: World) -> list[Pose]:
        """Place the patches in the world."""
        arm, fingers = world.joints()
        frames = link_frames(self._robot, self._tool, arm[None], fingers[None])
        poses = []
        for face in self.faces:
            rotations, positions = frames[face.bearer]
            matrix = np.eye(4)
            matrix[:3, :3] = rotations[0]
            matrix[:3, 3] = positions[0]
            poses.append(Pose.from_matrix(matrix) @ face.pose)

        return poses

    def _bear(self, face: Face, place: Pose, state: State, on: bool) -> None:
        """Hold a body, or let it go: it is switched off, or loads its grip too much."""
        if face.grip.switched and not on:
            self._let_go(face, "")
            return

        forces = self._pull(face, place, state.pose(face.body))
        face.forces.append(forces)
        if len(face.forces) < self._kept:
            return

        assert face.springs is not None
        mean = np.mean(face.forces, axis=0)
        load = Load.of(mean, face.springs.anchors, place.rotation_matrix)
        worst = max(face.grip.limits(load), key=lambda limit: limit.share)
        if face.hardest is None or worst.share > face.hardest.share:
            face.hardest = worst
        if worst.share >= 1:
            self._let_go(face, str(worst))

    def _pull(self, face: Face, place: Pose, pose: Pose) -> Array:
        """Let the springs of a face pull in the next step, and return their forces on the body (3, 3), N."""
        springs = face.springs
        assert springs is not None
        points = pose.apply(springs.points)
        lengths = place.apply(springs.anchors) - points
        rates = (lengths - springs.lengths) / self._time_step
        springs.lengths = lengths
        forces = springs.stiffness * lengths + springs.damping * rates
        self.push(face.body, forces, points)
        self.push("", -forces, points)
        return forces

    def _hold(self, face: Face, body: Body, place: Pose, pose: Pose) -> None:
        """Hold a body by springs, which are so stiff as the step allows."""
        inertia = inertia_of(body)
        gyration = float(inertia.moments.min()) / inertia.mass
        anchors = max(face.grip.radius_m, math.sqrt(2 * gyration)) * _AROUND
        points = pose.inverse().apply(place.apply(anchors))
        rate = _SWINGS / self._time_step
        stiffness = rate**2 / _find_fastest(inertia, points)
        face.springs = _Springs(
            anchors,
            points,
            stiffness,
            2 * _DAMPING * stiffness / rate,
            np.zeros((3, 3)),
        )
        self.collide(body.name, collide=False)
        face.body = body.name
        face.begun_s = self._now
        face.hardest = None
        face.forces.clear()

    def _let_go(self, face: Face, why: str) -> None:
        if not any(other.body == face.body for other in self.faces if other != face):
            self.collide(face.body, collide=True)
        self._note(face, face.body, face.begun_s, self._now, why)
        face.lost = face.body if why else ""
        face.body = ""

    def _look(self, face: Face, place: Pose, state: State, on: bool) -> None:
        """Take hold of the first body that touches a whole patch; note what it touches in vain."""
        near = ""
        for target in self._targets:
            pose = target.body.pose_in(state)
            away = float(np.linalg.norm(pose.position - place.position))
            if away > target.reach + face.grip.radius_m + _AWAY_M:
                continue

            gaps = _measure_gaps(target, pose.inverse() @ place, face.grip)
            if gaps.min() > _AWAY_M:
                continue
            if face.lost == target.body.name:
                near = face.lost
                continue
            if gaps.min() > TOUCH_M:
                continue

            gap = float(gaps.mean())
            coming = face.gap - gap > _SLOW_M
            face.gap = gap
            if coming:
                near = face.lost
                continue

            why = self._find_obstacle(face.grip, target.body, gaps, on)
            if why is None:
                self._hold(face, target.body, place, pose)
                return
            if why:
                self._note(face, target.body.name, self._now, math.inf, why)
                near = target.body.name

        face.lost = near

    def _find_obstacle(
        self, grip: Grip, body: Body, gaps: Array, on: bool
    ) -> str | None:
        """Say why a grip does not hold a body that it touches; None: it does; empty: it is off, or not there yet."""
        if grip.switched and not on:
            return ""
        why = grip.find_obstacle(body)
        if why:
            return why
        if gaps.max() > TOUCH_M:
            touching = int((gaps <= TOUCH_M).sum())
            whole = "and the whole patch must lie on it"
            beside = gaps[0] > TOUCH_M  # it may just pass
            return (
                ""
                if beside
                else f"it touched {touching} of {len(gaps)} points of the patch, {whole}"
            )
        return None

    def _note(
        self, face: Face, body: str, begin_s: float, end_s: float, why: str
    ) -> None:
        hardest = face.hardest if face.body else None
        if face.body and hardest is None:
            hardest = _NOTHING
        self._done.append(
            Gripped(face.component, face.grip.kind, body, begin_s, end_s, why, hardest)
        )


_NOTHING = Limit("load", 0.0, math.inf, "N")


def _find_fastest(inertia: Inertia, points: Array) -> float:
    """Find the square of the fastest rate at which a body swings on springs of 1 N/m, 1/s^2.

    Args:
        inertia: of the body.
        points: at which they hold it, in its frame (N, 3), m.
    """
    around = inertia.frame.inverse().apply(points)
    moves = np.concatenate([np.hstack([np.eye(3), -_cross(point)]) for point in around])
    yields = np.append(np.full(3, 1 / inertia.mass + 1 / _ARM_KG), 1 / inertia.moments)
    swings = np.sqrt(yields)[:, None] * (moves.T @ moves) * np.sqrt(yields)
    return float(np.linalg.eigvalsh(swings)[-1])


def _cross(point: Array) -> Array:
    """Return the matrix (3, 3) that takes the cross product of a point (3,) with what it is applied to."""
    return np.cross(np.eye(3), point).T


def find_moving(robot: Robot, tool: Tool, bearer: str) -> str:
    """Find the link that moves what hangs from a bearer, for engines that merge links which are joined rigidly."""
    arm = assembled(robot, tool, fused=True)
    while arm.joints[bearer].kind == "fixed":
        bearer = arm.joints[bearer].parent

    return bearer


def _aim_at(body: Body) -> _Target:
    solids = tuple(body_solids(body, frame=0))
    reach = 0.0
    for solid in solids:
        middle, half = solid.bounds()
        reach = max(reach, float(np.linalg.norm(np.abs(middle) + half)))

    return _Target(body, solids, reach)


def _measure_gaps(target: _Target, place: Pose, grip: Grip) -> Array:
    """Measure how far a body is from each point of a patch, whose frame is ``place`` in the body's (N,), m."""
    gaps = []
    for point in place.apply(grip.points):
        probe = Solid("", _PROBE, Pose(point))
        gap, _, _ = closest([probe], target.solids)
        gaps.append(abs(gap + _POINT_M))

    return np.array(gaps)
