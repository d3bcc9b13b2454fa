"""Look at a world while a plan is carried out: with noise, and without what is hidden from the camera."""

from __future__ import annotations

import math
from functools import cached_property

import coal
import numpy as np

from core.design import DesignError, Tool
from core.designs.planning import blur, look
from core.designs.sighting import SceneJudge, measure_box
from core.geometry import Array, Pose
from core.interfaces import (
    Look,
    Looked,
    Recording,
    RolloutSettings,
    Sighted,
    Task,
)
from core.robot.kinematics import arm_of
from core.robot.solids import box_corners
from core.scene import Scene, Soft, State
from core.solids.rollout_solids import ROBOT
from core.solids.tracks import Track, follow

LEAST_SEEN = 0.25
"""Of fewer of a body's points that the camera sees, the body is hidden."""

NEAREST = 0.1
"""The least share of the usual noise that a camera in the hand sees with, however near it is."""

HAND_FOV_DEG = 80.0
"""The angle of the cone that a camera in the hand sees, about the direction in which the tool hangs."""

_SHRUNK = 0.9  # corners of a body's box, which the body itself does not reach
_RAY_M = 1e-4  # the radius of a ray
_EYE_M = 1e-3  # a ray ends before what it comes from


class Lookout:
    """Looks at the worlds of one layout, whatever plays them.

    Args:
        task: has the robot, the camera and the goals.
        scene: the layout.
        tool: what the arm holds, which may hide bodies.
        seed: of the layout.
        settings: say how exactly is seen, and from where.
    """

    def __init__(
        self,
        task: Task,
        scene: Scene,
        tool: Tool,
        seed: int,
        settings: RolloutSettings,
    ) -> None:
        self._task = task
        self._scene = scene
        self._tool = tool
        self._seed = seed
        self._perception = task.perceive(settings.perception)

    def look(
        self,
        time: float,
        arm: Array,
        fingers: Array,
        state: State,
        before: tuple[Sighted, ...],
    ) -> Sighted:
        """Return what is seen of a world.

        Args:
            time: when, seconds of the motion.
            arm: the joints (J,).
            fingers: those of the fingers, and of the tool (F + K,).
            state: of the free bodies.
            before: what was seen by the looks before.
        """
        taken = Recording(
            np.array([time]), arm[None], fingers[None], State.stack([state])
        )
        tracks = follow(self._scene, self._task.robot, self._tool, taken).items
        eye = self._eye(arm)
        poses = self._poses(state)
        nearness = {name: self._nearness(eye, pose) for name, pose in poses.items()}
        seen = blur(poses, self._seed, self._perception, len(before) + 1, nearness)

        last = before[-1] if before else self._first
        hidden = {
            name: last.taken_s.get(name, last.at_s)
            for name, pose in poses.items()
            if not self._is_seen(name, pose, eye, tracks)
        }
        kept = {name: last.poses[name] for name in hidden}
        known_s = time + self._perception.look_s

        return Sighted({**seen, **kept}, time, known_s, hidden)

    def report(self, asked: Look, looks: tuple[Sighted, ...]) -> Looked:
        """Say what a look found out.

        Args:
            asked: where it stands in the plan.
            looks: what was seen by each look until then, the last one by this.
        """
        seen = looks[-1]
        left = []
        for number, goal in self._judge.goals().items():
            try:
                left.append((goal.label(number), self._judge.left(number, seen.poses)))
            except (DesignError, LookupError, ValueError):
                continue  # a goal is a hint, and may not fit the scene

        return Looked(
            len(looks),
            seen.at_s,
            asked.after,
            asked.where,
            seen.hidden,
            tuple(left),
        )

    @cached_property
    def _first(self) -> Sighted:
        seen = look(self._task, self._seed, self._perception, self._scene)
        return Sighted(seen.poses)

    @cached_property
    def _judge(self) -> SceneJudge:
        return SceneJudge(self._task, self._scene, self._first.poses)

    def _poses(self, state: State) -> dict[str, Pose]:
        """Return where bodies and marks are."""
        return {body.name: body.pose_in(state) for body in self._scene.bodies}

    @property
    def _in_hand(self) -> bool:
        return self._perception.camera == "hand"

    def _eye(self, arm: Array) -> Pose:
        """Return where the camera is; one in the hand looks along the mount's -z."""
        if self._in_hand:
            return arm_of(self._task.robot).forward(arm)
        return Pose(np.asarray(self._task.camera.position, dtype=np.float64))

    def _nearness(self, eye: Pose, pose: Pose) -> float:
        """Compute the distance to a body as a share of the usual one: that of the task's camera to what it looks at."""
        if not self._in_hand:
            return 1.0

        camera = self._task.camera
        usual = math.dist(camera.position, camera.target)
        share = math.dist(eye.position, pose.position) / usual
        return min(max(share, NEAREST), 1.0)

    def _is_seen(self, name: str, pose: Pose, eye: Pose, tracks: list[Track]) -> bool:
        """Report whether enough of a body's points can be seen.

        Args:
            name: of the body.
            pose: of the body.
            eye: the camera.
            tracks: the solids of the robot and of all bodies at one instant.
        """
        if isinstance(self._scene[name], Soft):
            return True

        middle, half = measure_box(self._scene, name)
        corners = box_corners(-half, half)
        points = pose.apply(middle + _SHRUNK * np.vstack([np.zeros(3), corners]))
        others = [track for track in tracks if track.owner != name]

        if self._in_hand:
            # It is mounted so that it sees past the tool.
            others = [track for track in others if track.owner != ROBOT]
            ahead = eye.inverse().apply(points)
            sines = -ahead[:, 2] / np.linalg.norm(ahead, axis=1)
            points = points[sines > math.cos(math.radians(HAND_FOV_DEG / 2))]

        free = [not _is_blocked(eye.position, point, others) for point in points]
        return sum(free) >= LEAST_SEEN * (1 + len(corners))


def _is_blocked(eye: Array, point: Array, tracks: list[Track]) -> bool:
    """Report whether a solid is between the camera and a point (3,)."""
    way = eye - point
    length = float(np.linalg.norm(way))
    if length < 2 * _EYE_M:
        return False

    ray = coal.Capsule(_RAY_M, length - 2 * _EYE_M)
    from trimesh.geometry import align_vectors  # trimesh takes half a second

    turn = align_vectors([0.0, 0.0, 1.0], way / length)[:3, :3]
    place = coal.Transform3s(turn, (eye + point) / 2)
    request = coal.CollisionRequest()

    return any(
        coal.collide(
            track.geometry, track.at(0), ray, place, request, coal.CollisionResult()
        )
        for track in tracks
    )
