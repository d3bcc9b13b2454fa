"""Check that nothing of a job is ignored: its scene, its targets, its blocks, and what the motors bear."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from core.design import Tool
from core.errors import UserError
from core.geometry import Array
from core.interfaces import Ability, Order, Rollout, Simulator, World
from core.robot.description import assemble
from core.scene import Scene, State, table
from core.simulation.playback import play as play_world
from plugins.conformance.scenery import box, cube, stick
from plugins.conformance.shared import LeftOut, expect, near
from plugins.conformance.worlds import Bodies, arm, end, film, motion, play, still

_HEAVY_KG = 2.0
_WITHIN = 0.03  # of the torque that statics says
_STEADY = 1e-3  # of a joint's limit: of one that bears nothing


def check_scene_of_the_job_is_played(simulator: Simulator) -> None:
    """A job's own scene counts, not the task's layout: perturbed scenes and those with a fixture come that way."""
    task = Bodies(table(), cube(at=(0.6, 0.0, 0.05)))
    other = Scene((table(), cube(at=(0.8, 0.2, 0.05))), ())
    outcome = play(simulator, task, Rollout(Tool(), still(), hold_s=0.1, scene=other))
    place = end(outcome).position("cube")
    near("where the cube of the job's scene is, m", place, (0.8, 0.2, 0.05), 2e-3)


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
    plan = [[0.45, 0, 0.3, 0, 0, 0], [0.6, 0, 0.3, 0, 0, 0]]
    job = Rollout(stick(0.25), motion(plan), settle_s=0.1, hold_s=0.2, record_hz=50.0)
    played = play(simulator, task, job)

    try:
        world = simulator.world(task, job.tool)
    except UserError as error:
        raise LeftOut(str(error)) from error

    stepped = play_world(_Stepped(world), job)
    places = film(stepped).states.positions
    near(
        "positions, played and stepped, m", film(played).states.positions, places, 1e-6
    )
    joints = film(stepped).arm
    near("joints, played and stepped, rad", film(played).arm, joints, 1e-6)
    ends = end(stepped).positions
    near("where bodies end, played and stepped, m", end(played).positions, ends, 1e-6)
    expect(
        abs(played.tracking_error_rad - stepped.tracking_error_rad) < 1e-6,
        "the arm's lag differs between a job that is played and one that is stepped",
    )


def check_motors_bear_what_statics_says(simulator: Simulator) -> None:
    """The arm holds a beam of 2 kg still. Its motors' greatest torques are those of statics."""
    beam = box("beam", (0.3, 0.04, 0.04), (0.15, 0.0, -0.03), mass=_HEAVY_KG)
    tool = Tool((beam,))
    outcome = play(
        simulator, Bodies(), Rollout(tool, still(), settle_s=1.0, hold_s=0.5)
    )
    supported = Ability.TORQUES in simulator.supports
    if outcome.torques is None:
        expect(not supported, "it is said to tell the motors' torques, and gave none")
        raise LeftOut("it does not say what motors apply")

    expect(supported, "it tells the motors' torques, which its class does not list")
    due = _bear(tool)
    limits = arm().effort_limits
    within = np.maximum(_WITHIN * due, _STEADY * limits)
    near("torques of the arm's motors, N m", outcome.torques, due, within)


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
