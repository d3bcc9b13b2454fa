"""Describe a scene with the arm and its tool as a MuJoCo spec, and compile that."""

from __future__ import annotations

from core.design import Tool
from core.robot.description import assembled
from core.scene import Scene
from core.values.robots import Robot
from plugins.simulators.mujoco import contacts
from plugins.simulators.mujoco.bodies import add_bodies
from plugins.simulators.mujoco.bonds import add_bonds
from plugins.simulators.mujoco.contacts import Collider, Role, Surface
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.forces import add_feeler
from plugins.simulators.mujoco.robot import add_servos, load, set_gains
from plugins.simulators.mujoco.shapes import Element, add_geom
from plugins.simulators.mujoco.softs import add_softs, hull_boxes
from plugins.simulators.rolling import rollers
from plugins.simulators.step_lengths import choose_step, spare_cards

MAX_TIME_STEP = 0.005  # s; above, contacts get soft
# m, of what is searched for a contact: at MuJoCo's own, 1e-6, lying cylinders roll by themselves.
CCD_TOLERANCE = 1e-10


def compile_model(
    robot: Robot,
    scene: Scene,
    tool: Tool,
    time_step: float,
    tracking_rate: float,
    slip_rate: float,
    steps_hz: float = 0.0,
) -> Element:
    """Compile the model: the arm's joints first, then those of the free bodies.

    Args:
        robot: the arm.
        scene: in the layout that is played.
        tool: what the arm holds.
        time_step: s, where the scene's bodies and the tool's springs need no other.
        tracking_rate: how fast a joint converges to its target, 1/s.
        slip_rate: how fast friction stops slow slip, 1/s.
        steps_hz: how many steps a second there are at least.

    Raises:
        UserError: the scene has what MuJoCo can't play.
    """
    usual = _choose_time_step(scene, time_step)
    time_step = choose_step(tool, scene, usual, steps_hz)
    spec = build_spec(robot, scene, tool, time_step, slip_rate)
    if any(rollers(body) for body in scene.bodies):
        spec.option.ccd_tolerance = CCD_TOLERANCE
    if len(scene.free) <= 1 and not scene.softs:
        # Equal but for rounding, and up to a tenth faster; not measured on a GPU.
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE

    last_joint = assembled(robot, tool, fused=True).named[robot.arm_joints[-1]]
    add_feeler(spec, last_joint.child)
    model = spec.compile()
    set_gains(model, robot, tool, tracking_rate)

    return model


def _choose_time_step(scene: Scene, time_step: float) -> float:
    """Return the time step that a scene's bodies need, s, where others get ``time_step``.

    Soft solids are as good at twice the step, for half the time; ropes that fall would pass through things, and cloths
    sink into what they lie on.
    Bodies that hang from moving ones gain energy in proportion to the step, so theirs is half as long. So is that of
    cards.
    """
    if scene.softs and all(soft.form.kind == "solid" for soft in scene.softs):
        time_step = min(2 * time_step, MAX_TIME_STEP)

    for joint in scene.joints:
        if joint.parent is not None and not scene[joint.parent].fixed:
            return time_step / 2

    return spare_cards(scene, time_step)


def build_spec(
    robot: Robot,
    scene: Scene,
    tool: Tool,
    time_step: float,
    slip_rate: float,
    slots: int = 0,
) -> Element:
    """Build the model's spec, without the servos' gains.

    Fixed bodies are all part of the world's body, for which MuJoCo has a tree of bounding boxes.

    Args:
        robot: the arm.
        scene: in the layout that is played.
        tool: what the arm holds.
        time_step: s.
        slip_rate: how fast friction stops slow slip, 1/s.
        slots: the fewest boxes on each mount, see `load`.
    """
    spec, colliders = load(robot, tool, slots)
    surfaces = [
        Surface(body.friction, body.rolling_friction, body.restitution)
        for body in scene.bodies
    ]
    contacts.set_options(
        spec, time_step, scene.gravity, bouncing=contacts.bounces(surfaces)
    )
    add_servos(spec, robot, tool)
    add_softs(spec, scene, contacts.tools_friction(colliders))
    bearers = add_bodies(spec, scene, awake=bool(tool.gripping))
    add_bonds(spec, scene, bearers)

    for body, surface in zip(scene.bodies, surfaces, strict=True):
        for part in body.collisions:
            bearer = bearers[body.name]
            pose = part.pose
            if body.fixed:
                pose = body.pose @ pose
            geom = add_geom(spec, bearer, part.shape, pose)
            collider = Collider(
                geom, body.name, bearer.name, Role.SCENE, surface, not body.fixed
            )
            colliders.append(collider)

    contacts.set_contacts(spec, colliders, slip_rate, scene.joined)
    if any(soft.form.kind == "cloth" for soft in scene.softs):
        hull_boxes(spec)
    return spec
