"""Check that nothing of a job is ignored: its scene, its targets, its blocks, its guards, and what the motors bear."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from core.design import Candidate, Tool
from core.designs.planning import named_actions, parse_plan
from core.errors import UserError
from core.geometry import Array, Box
from core.interfaces import (
    Ability,
    Feel,
    Order,
    Rollout,
    RolloutSettings,
    Simulator,
    World,
)
from core.robot.description import assemble
from core.scene import Body, Scene, State, table
from core.simulation.attempt import prepare
from core.simulation.playback import play as play_world
from core.values.jobs import FEEL_S
from plugins.conformance.sample_tools import box, stick
from plugins.conformance.shared import LeftOut, near
from plugins.conformance.worlds import (
    Bodies,
    Film,
    arm,
    cube,
    make_body,
    motion,
    play,
    still,
    watch,
)

_HEAVY_KG = 2.0
_WITHIN = 0.03  # of the torque that statics says
_STEADY = 1e-3  # of a joint's limit: of one that bears nothing


def check_scene_of_the_job_is_played(simulator: Simulator) -> None:
    """A job's own scene counts, not the task's layout: perturbed scenes and those with a fixture come that way."""
    other = Scene((table(), cube(at=(0.8, 0.2, 0.05))), ())
    cubes = (table(), cube(at=(0.6, 0.0, 0.05)))
    end = watch(simulator, *cubes, scene=other, hold_s=0.1).path("cube")[-1]
    near("where the cube of the job's scene is, m", end, (0.8, 0.2, 0.05), 2e-3)


class _Stepped(World):
    """A world that is only stepped: `core.interfaces.World` does the rest."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.time_step = world.time_step

    def step(self, order: Order) -> None:
        self._world.step(order)

    def joints(self) -> tuple[Array, Array]:
        return self._world.joints()

    def state(self) -> State:
        return self._world.state()

    def launch(self) -> None:
        self._world.launch()


def check_fast_ways_are_what_steps_give(simulator: Simulator) -> None:
    """A job that is played as the engine can, and one that is stepped from outside, end and are filmed alike."""
    task = Bodies(table(), cube(at=(0.6, 0.0, 0.05)))
    way = motion([[0.45, 0, 0.3, 0, 0, 0], [0.6, 0, 0.3, 0, 0, 0]])
    job = Rollout(stick(0.25), way, settle_s=0.1, hold_s=0.2, record_hz=50.0)
    played = Film(task.scene(0), play(simulator, task, job))
    try:
        world = simulator.world(task, job.tool)
    except UserError as error:
        raise LeftOut(str(error)) from error

    stepped = Film(task.scene(0), play_world(_Stepped(world), job))
    places = stepped.path("cube")
    near("positions, played and stepped, m", played.path("cube"), places, 1e-6)
    joints = stepped.recording.arm
    near("joints, played and stepped, rad", played.recording.arm, joints, 1e-6)
    lag = stepped.outcome.tracking_error_rad
    near(
        "the arm's lag, played and stepped, rad",
        played.outcome.tracking_error_rad,
        lag,
        1e-6,
    )


def check_going_on_is_playing_whole(simulator: Simulator) -> None:
    """A job that goes on from where it was stopped, while the arm pushes a cube, is to the bit the one played whole."""
    if Ability.FORKS not in simulator.supports:
        raise LeftOut(f"it does not support {Ability.FORKS}")

    task = Bodies(table(), cube(at=(0.6, 0.0, 0.05)))
    way = motion([[0.45, 0, 0.3, 0, 0, 0], [0.6, 0, 0.3, 0, 0, 0]])
    job = Rollout(stick(0.25), way, settle_s=0.1, hold_s=0.2, record_hz=50.0)
    whole = Film(task.scene(0), play(simulator, task, job))
    point = simulator.stop_at(task, job, 0.8 * way.duration)
    rest = Film(task.scene(0), play(simulator, task, replace(job, begins=point)))

    begins_s = rest.outcome.begins_s
    assert begins_s > 0, "it plays from the start what has a stored state"
    near("the cube, whole and gone on, m", rest.path("cube"), whole.path("cube"), 0.0)
    joints = whole.recording.arm
    near("joints, whole and gone on, rad", rest.recording.arm, joints, 0.0)


def check_motors_bear_what_statics_says(simulator: Simulator) -> None:
    """The arm holds a beam of 2 kg still. Its motors' greatest torques are those of statics."""
    beam = box("beam", (0.3, 0.04, 0.04), (0.15, 0.0, -0.03), mass=_HEAVY_KG)
    tool = Tool((beam,))
    found = watch(simulator, tool=tool, settle_s=1.0, hold_s=0.5).outcome.torques
    is_listed = Ability.TORQUES in simulator.supports
    if found is None:
        assert not is_listed, "it is said to tell the motors' torques, and gave none"
        raise LeftOut("it does not say what motors apply")

    assert is_listed, "it tells the motors' torques, which its class does not list"
    due = _bear(tool)
    within = np.maximum(_WITHIN * due, _STEADY * arm().effort_limits)
    near("torques of the arm's motors, N m", found, due, within)


def _bear(tool: Tool) -> Array:
    """Compute the torques that hold the arm with a tool at home (J,), N m."""
    robot = arm().robot
    model = pin.buildModelFromXML(assemble(robot, tool, visuals=False))
    names = [str(name) for name in model.names][1:]
    columns = [names.index(name) for name in robot.arm_joints]
    joints = pin.neutral(model)
    joints[columns] = still().arm[0]
    torques: Array = pin.computeGeneralizedGravity(model, model.createData(), joints)

    return np.abs(torques[columns])


# --- guards -----------------------------------------------------------------------------------------------------

_STICK = 0.2  # m
_TOP = 0.1  # m: of the block
_SPEED = 0.05  # m/s
_STOP_M = 0.003  # within so much of the wall a touch ends: the way in two readings, and what the contact yields
_STRONG_N = 40.0  # friction holds the cube with 5 N


def _mounts(
    simulator: Simulator, steps: list[Any], *bodies: Body, fired: tuple[str, ...]
) -> Array:
    """Play a plan with guards; where the mount is when each ends, and at the end, (G + 1, 3) m.

    Args:
        simulator: plays it.
        steps: the waypoints, as ``action=anchored`` has them; in the world, so that they are the same wherever a guard
            ends.
        bodies: of the scene.
        fired: the guards that should end ways, in order.

    Raises:
        LeftOut: the engine plays no motions with guards.
        AssertionError: the rollout broke, or other guards ended ways.
    """
    task = Bodies(*bodies)
    settings = RolloutSettings(settle_s=0.1, hold_s=0.3, feel=Feel(noise=0.05))
    plan = parse_plan(named_actions({"action": "anchored"}), steps, gripper=False)
    _, job = prepare(task, Candidate(stick(_STICK), plan), 0, settings, 1 / FEEL_S)

    played = Film(task.scene(0), play(simulator, task, job))
    felt = played.outcome.felt
    found = tuple(guard.fired for guard in felt)
    assert found == fired, f"what guards fired: {found} instead of {fired}"

    at_s = [guard.at_s for guard in felt]
    instants = np.searchsorted(played.times[:-1], np.array([*at_s, np.inf]) - 1e-6)
    places: Array = arm().positions(played.recording.arm[instants])
    return places


def check_that_touch_ends_at_a_wall(simulator: Simulator) -> None:
    """Two guards in a row: down until touched, up, and down again; each ends where the block begins.

    After the last one the arm rests there too, since no waypoint follows.
    """
    block = make_body("block", Box((0.2, 0.2, _TOP)), (0.55, 0.0, _TOP / 2))
    high = {"offset": [0.55, 0.0, 0.35]}
    low = {"offset": [0.55, 0.0, _STICK + _TOP / 2], "speed": _SPEED, "until": "touch"}
    steps = [high, low, high, low]
    ends = _mounts(simulator, steps, block, fired=("touch", "touch"))
    near(
        "where two touches of a block end, and the arm rests, m",
        ends[:, 2],
        _STICK + _TOP,
        _STOP_M,
    )


def check_that_force_ends_a_push(simulator: Simulator) -> None:
    """A cube of 1 kg slides with less than the guard asks for, until a wall holds it.

    So the push ends where the cube, which is 0.1 m wide, is between the stick and the wall.
    """
    floor = make_body("floor", Box((2.0, 2.0, 0.1)), (0.5, 0.0, -0.05))
    pushed = cube("cube", (0.55, 0.0, 0.05))
    wall = make_body("wall", Box((0.05, 0.6, 0.2)), (0.75, 0.0, 0.1))

    before = {"offset": [0.42, 0.0, _STICK + 0.03]}
    push = {
        "offset": [0.72, 0.0, _STICK + 0.03],
        "speed": _SPEED,
        "until": "force",
        "newtons": _STRONG_N,
    }
    bodies = (pushed, wall, floor)
    ended, _ = _mounts(simulator, [before, push], *bodies, fired=("force",))
    near(
        f"where a push of a cube to {_STRONG_N} N ends, x in m", ended[0], 0.615, 0.005
    )
