"""Load the arm with a tool into MuJoCo: links, colliders and servos."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from core.design import Tool
from core.geometry import Array
from core.robot.description import assemble, joint_name
from core.values.robots import Robot
from plugins.simulators.links import bearers, friction_of
from plugins.simulators.mujoco.contacts import Collider, Role, Surface, is_discrete
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element, set_springs

FINGER_INERTIA = 0.5  # kg, a guess: a spindle is hard to push back
# The impedance of dry friction in a joint: it hardly creeps.
HOLDS = [0.9999, 0.9999, 0.001, 0.5, 2.0]
GIVES_WAY = 0.015  # m or rad: so far off a scene's drive does its full force
LIFTS_RATE = 5.0  # 1/s: how fast its integral makes up for what it bears
_AHEAD = 3.0  # how many times faster a joint's speed converges than its position


def load(robot: Robot, tool: Tool, slots: int = 0) -> tuple[Element, list[Collider]]:
    """Make a spec of the arm with a tool, and list its colliders. Rigidly joined links become one body.

    Args:
        robot: the arm.
        tool: what it holds.
        slots: the fewest boxes on each mount. Unused ones are a millimetre wide, weigh nothing, and are a kilometre
            away, also from those on another mount.
    """
    assets: dict[str, bytes] = {}

    def asset(path: Path) -> str:
        """Keep a mesh's data, and name it in the description."""
        name = f"{len(assets)}_{path.name}"  # meshes of two folders may have one name
        assets[name] = path.read_bytes()
        return name

    urdf = assemble(
        robot,
        tool,
        fused=True,
        visuals=False,
        mesh_path=asset,
    )
    spec = mujoco.MjSpec.from_string(urdf, assets=assets)
    spec.compiler.degree = False
    near = bearers(robot, tool)
    used = Counter(mount for mount, _ in tool.placed().values())
    for number, mount in enumerate(tool.mounts, start=1):
        away = [0.0, 0.0, 1000.0 * number]
        for _ in range(slots - used[mount]):
            spec.body(mount).add_geom(
                type=mujoco.mjtGeom.mjGEOM_BOX, size=[5e-4] * 3, pos=away, mass=0.0
            )

    # Which link each is of, before fused bodies forget it.
    links = [(geom, geom.parent.name) for geom in spec.geoms]
    spec.fuse_static()
    colliders = []
    for geom, link in links:
        owner = link
        role = Role.ARM

        if link in tool.borne_on:
            owner = "tool"
            role = Role.TOOL
        elif link in near:
            role = Role.BEARER

        surface = Surface(friction_of(robot, tool, link))
        colliders.append(
            Collider(
                geom,
                owner,
                geom.parent.name,
                role,
                surface,
            )
        )

    for bearer in tool.bearers:
        body = spec.body(bearer.name)
        spec.add_exclude(bodyname1=body.name, bodyname2=body.parent.name)
        set_springs(spec.joint(joint_name(bearer.name)), bearer.joint)

    return spec, colliders


def add_servos(spec: Element, robot: Robot, tool: Tool) -> None:
    """Add position control with velocity feed-forward; `set_gains` sets the gains later.

    Gravity of the arm and its tool is compensated: those torques are known, and count towards a joint's limit. The
    fingers' coupling in the description becomes a constraint.

    Args:
        spec: has the arm with its tool, see `load`.
        robot: the arm.
        tool: what it holds; its joints get no servo.
    """
    loose = {bearer.name for bearer in tool.bearers}
    for body in spec.bodies:
        body.gravcomp = float(body.name not in {"world", *loose})

    for joint in spec.joints:
        joint.solref_limit = [2 * spec.option.timestep, 1.0]
        if joint.parent.name in loose:
            joint.solref_friction = joint.solref_limit
            joint.solimp_friction = HOLDS
            continue

        joint.actgravcomp = True
        if robot.gripper is not None and joint.name in robot.gripper.joints:
            force = robot.gripper.force_n
            joint.actfrcrange = [-force, force]
            joint.armature = FINGER_INERTIA
        else:  # the description's effort is the limit
            joint.armature = robot.motor_inertia[robot.arm_joints.index(joint.name)]

        servo = spec.add_actuator(
            name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        servo.set_to_pid(kp=1.0, kv=1.0)

    for coupling in spec.equalities:
        coupling.solref = [2 * spec.option.timestep, 1.0]


def set_gains(model: Element, robot: Robot, tool: Tool, tracking_rate: float) -> None:
    """Place each joint's two poles, by its inertia at home: one at the tracking rate, one faster.

    Take the inertia M, the time step h, a = h kv / M and b = h^2 kp / M. A step changes the error x and its rate v to
    v' = (v - b x / h) / (1 + a + b) if forces are those at the step's end, and to v' = (v - b x / h) / (1 + a) if only
    speeds are; then x' = x + h v'. The product and the sum of the two factors by which errors shrink, exp(-rate h),
    give a and b.

    A faster second pole would follow better, but a joint at its force limit would move too far within a step, and
    shake. What a scene's drive will bear is not known here, and is no part of its inertia. So it is at least so stiff
    that it does its full force where it is `GIVES_WAY` off, and damped for such a load; its integral then lifts that.

    Args:
        model: compiled; its servos are changed.
        robot: the arm.
        tool: what it holds.
        tracking_rate: of the slower pole, 1/s.
    """
    data = mujoco.MjData(model)
    data.qpos[: len(robot.home)] = robot.home
    mujoco.mj_forward(model, data)

    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    count = len(model.actuator_biasprm)

    h = model.opt.timestep
    shrink = np.exp(-h * tracking_rate * np.array([1.0, _AHEAD]))
    product = float(np.prod(shrink))
    total = float(np.sum(shrink))
    if is_discrete(model.opt):
        b = 1 - (total - 1) / product
        a = 1 / product - 1 - b
    else:
        a = 1 / product - 1
        b = (1 + product - total) / product

    joints = model.actuator_trnid[:count, 0]
    masses: Array = np.diag(inertia)[model.jnt_dofadr[joints]]
    drives = slice(len(robot.joints(tool.gripper)), None)
    stiffness = model.jnt_actfrcrange[joints[drives], 1] / GIVES_WAY
    masses[drives] = np.maximum(masses[drives], stiffness * h**2 / b)
    model.actuator_gainprm[drives, 0] = LIFTS_RATE * b * masses[drives] / h**2
    model.actuator_biasprm[:, 1] = -b * masses / h**2
    model.actuator_biasprm[:, 2] = -a * masses / h
