"""The code that a prompt shows of how waypoints are executed does what the arm does."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from core.designs.prompt_templates import PromptTemplates
from core.geometry import Pose
from core.interfaces import RolloutSettings, Waypoints
from core.robot.timing import Leg, time_leg
from core.robot.trajectory import plan_motion
from tests.support.panda import ARM

HOME = Pose.xyz_rpy((0.5, 0.0, 0.5))
NEAR = (0.50, 0.02, 0.48, 0.0, 0.0, 0.0, 0.0)  # in the time of a segment
FAR = (0.35, -0.40, 0.30, 0.0, 0.0, -0.6, 1.0)  # as fast as the joints can
OPENED = (*FAR[:6], 0.0)  # the fingers alone
ELSEWHERE = (0.60, 0.30, 0.20, 0.0, 0.4, 0.4, 0.0)
PLAN = np.array([NEAR, FAR, OPENED, ELSEWHERE])


class Shown:
    """What the shown code drives: it notes the moves."""

    def __init__(self):
        self.moves = []

    def joints_for(self, pose):
        return ARM.home_for(pose)

    def nearest_joints(self, position, rotation, joints):
        found, _ = ARM.follow(
            position[None], rotation.as_matrix()[None], joints, ARM.jump_rad
        )
        return found[0]

    def move(self, path, grip, seconds, share_of_limits):
        leg = Leg(
            np.array(path),
            [0, len(path) - 1],
            np.zeros(2),
            np.array([seconds]),
            np.array([np.nan]),
            hurried=False,
            wait_s=0.0,
        )
        took_s = time_leg(leg, ARM, share_of_limits).times[-1]
        self.moves.append((np.array(path), grip, took_s))


def slerp(first, last, share):
    return Slerp([0, 1], Rotation.concatenate([first, last]))(share)


def shown_moves(settings):
    templates = PromptTemplates(None)
    templates.load("executor")
    text = templates.fill("executor", {"rollout": settings}).text
    code = text.partition("```python\n")[2].partition("```")[0]
    names = {"np": np, "slerp": slerp}
    exec(compile(code, "prompts/executor.md.j2", "exec"), names)
    waypoints = []
    for *pose, grip in PLAN:
        rotation = Rotation.from_euler("xyz", pose[3:])
        point = np.array(pose[:3])
        waypoints.append(SimpleNamespace(position=point, rotation=rotation, grip=grip))
    arm = Shown()
    names["execute"](waypoints, HOME, arm)
    return arm.moves


@pytest.mark.parametrize(
    "settings", [RolloutSettings(), RolloutSettings(segment_s=0.8, speed=0.5)]
)
def test_the_arm_does_what_the_prompt_shows(settings):
    moves = shown_moves(settings)
    motion = plan_motion(
        Waypoints(PLAN), HOME, ARM, segment_s=settings.segment_s, speed=settings.speed
    )
    seconds = np.array([move[2] for move in moves])
    assert (seconds >= settings.segment_s - 1e-9).all()
    assert seconds[1] > 1.5 * settings.segment_s
    assert seconds[2] == pytest.approx(settings.segment_s)
    assert motion.arrivals == pytest.approx(np.cumsum(seconds), rel=0.03)

    trajectory = motion.trajectory
    speeds = np.diff(trajectory.arm, axis=0) / np.diff(trajectory.times)[:, None]
    shares = np.abs(speeds).max(axis=0) / ARM.velocity_limits
    assert 0.9 * settings.speed < shares.max() <= 1.001 * settings.speed

    begin_s = 0.0
    opening = ARM.robot.opening_m
    before = 0.0
    for (path, grip, _), arrival in zip(moves, motion.arrivals, strict=True):
        times = np.linspace(begin_s, arrival, 30)
        arm, fingers = motion.trajectory.sample(times)
        # Each sample lies near one of the shown path, and the last one at its end.
        gaps = np.linalg.norm(
            ARM.positions(arm)[:, None] - ARM.positions(path)[None], axis=-1
        )
        assert gaps.min(axis=1).max() < 0.012  # the shown path has 50 points
        assert arm[-1] == pytest.approx(path[-1], abs=0.02)
        grips = 1 - fingers / opening
        assert grips == pytest.approx(np.linspace(before, grip, 30), abs=0.02)
        begin_s = arrival
        before = grip
