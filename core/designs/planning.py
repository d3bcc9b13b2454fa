"""Read action plans, and resolve them: the waypoints that a plan means in one layout, by what is seen there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import DesignError
from core.designs.plan_rules import check_plan, check_tempo
from core.designs.sighting import SceneJudge
from core.errors import UserError
from core.geometry import Array, Pose
from core.interfaces import (
    ActionPlan,
    ActionRepresentation,
    Perception,
    RolloutSettings,
    Seen,
    Sighted,
    Task,
    Waypoints,
)
from core.plugins import ACTION, PluginPart
from core.plugins.blame import call_part
from core.scene import Scene
from core.support.text import kind
from core.values.refusals import DesignReason

# Keep these random numbers apart from others of the same seed.
_NOISE = 7
_HEIGHT = 8


def named_actions(design: dict[Any, Any]) -> ActionRepresentation:
    """Make the representation that a design of a designs file names; of those without a name, literal waypoints.

    Raises:
        DesignError: there is none of that name, or it can't be made.
    """
    name = design.get("action", Waypoints.action)
    if not isinstance(name, str):
        raise DesignError.because(DesignReason.ACTION_WORD, given=kind(name))

    part: PluginPart[ActionRepresentation] = PluginPart(ACTION.name, name)
    try:
        return part.shared()
    except UserError as error:
        raise DesignError(str(error)) from error


def parse_plan(actions: ActionRepresentation, raw: object, gripper: bool) -> ActionPlan:
    """Parse a plan.

    Raises:
        DesignError: a rule is broken, or the representation fails; then the message names its plugin.
    """
    plan: ActionPlan = call_part(actions, "parse", ActionPlan, raw, gripper=gripper)
    return plan


def look(
    task: Task,
    seed: int,
    perception: Perception,
    scene: Scene | None = None,
) -> Seen:
    """Return what is seen of the layout of ``seed`` before the motion: all poses as at spawn, with noise.

    The noise is normal, of each coordinate in the plane of the table and of the yaw; it depends on ``seed`` alone.
    ``scene`` is the layout, if it is there already.
    """
    perception = task.perceive(perception)
    scene = scene or task.scene(seed)
    poses = {body.name: body.pose for body in scene.bodies}
    seen = blur(poses, seed, perception)

    return Seen(seen, judge=SceneJudge(task, scene, seen))


def blur(
    poses: Mapping[str, Pose],
    seed: int,
    perception: Perception,
    number: int = 0,
    nearness: Mapping[str, float] | None = None,
) -> dict[str, Pose]:
    """Add noise to what is seen.

    Args:
        poses: of bodies and marks, by name.
        seed: of the layout. With ``number``, and the order of the bodies, it alone decides what is drawn.
        perception: how much noise there is.
        number: of the look; 0 is what is seen before the motion.
        nearness: by which share of the usual distance each is seen, which is that of its noise; None: the usual one.
    """
    if perception.position == perception.yaw == 0:
        return dict(poses)

    key = [seed, _NOISE, number] if number else [seed, _NOISE]
    draws = np.random.default_rng(key).standard_normal((len(poses), 3))
    seen = {}

    for (name, pose), (x, y, yaw) in zip(poses.items(), draws.tolist(), strict=True):
        share = 1.0 if nearness is None else nearness[name]
        turn = Rotation.from_rotvec([0.0, 0.0, share * yaw * perception.yaw])
        shift = share * perception.position * np.array([x, y, 0.0])
        seen[name] = Pose.from_rotation(pose.position + shift, turn * pose.rotation)

    return seen


def resolve(
    plan: ActionPlan,
    task: Task,
    seed: int,
    settings: RolloutSettings,
    scene: Scene | None = None,
    felt: tuple[Pose | None, ...] = (),
    looks: tuple[Sighted, ...] = (),
) -> Waypoints:
    """Return a plan's waypoints in the layout of ``seed``.

    ``scene``: see `look`; ``felt`` and ``looks``: see `Seen`.

    Raises:
        DesignError: the plan needs something that is not there, or its waypoints break a rule.
    """
    rise = _rise(seed, settings.perception)
    waypoints: Waypoints

    if isinstance(plan, Waypoints):
        waypoints = plan
        check_tempo(waypoints, task.home, settings.max_motion_s)
    else:
        seen = look(task, seed, settings.perception, scene)
        # Where the plan means those poses to be that the arm reached.
        meant = [pose and Pose(pose.position - rise, pose.quaternion) for pose in felt]
        seen = replace(seen, felt=tuple(meant), looks=looks)
        waypoints = resolve_seen(plan, task, settings, seen)

    if not rise.any():
        return waypoints

    poses = waypoints.poses.copy()
    poses[:, :3] += rise
    return replace(waypoints, poses=poses)


def resolve_seen(
    plan: ActionPlan, task: Task, settings: RolloutSettings, seen: Seen
) -> Waypoints:
    """Return the waypoints that a plan means by what is known of the scene.

    Raises:
        DesignError: the plan needs something that is not there, or its waypoints break a rule.
    """
    sight = task.perceive(settings.perception)
    seen = replace(
        seen, noise=(sight.position, sight.yaw), most_s=settings.max_motion_s
    )
    waypoints: Waypoints = call_part(plan, "resolve", Waypoints, seen)
    check_plan(waypoints.poses, gripper=waypoints.poses.shape[-1] == 7)
    check_tempo(waypoints, task.home, settings.max_motion_s)
    return waypoints


def _rise(seed: int, perception: Perception) -> Array:
    """Draw by how much (3,) the arm's waypoints lie higher than a plan means in the layout of ``seed``, metres."""
    rise = np.zeros(3)
    if perception.height != 0:
        draw = np.random.default_rng([seed, _HEIGHT]).uniform(-1, 1)
        rise[2] = perception.height * draw

    return rise
