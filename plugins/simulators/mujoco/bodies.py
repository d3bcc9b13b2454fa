"""Add a scene's bodies and joints to a MuJoCo spec, move what moves by itself, and read states."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from core.scene import Body, Scene, State
from core.values.joints import Joint, PlacedJoint, Placement, multiply, rotate
from plugins.simulators.forces import latch_force
from plugins.simulators.inertia import ROTOR, inertia_of
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.robot import HOLDS
from plugins.simulators.mujoco.shapes import Element, add_body, set_springs
from plugins.simulators.mujoco.softs import Softs

_KINDS = {
    "hinge": mujoco.mjtJoint.mjJNT_HINGE,
    "slider": mujoco.mjtJoint.mjJNT_SLIDE,
    "ball": mujoco.mjtJoint.mjJNT_BALL,
}
_BACK = np.array([1.0, -1.0, -1.0, -1.0])  # makes a quaternion the inverse


def add_bodies(spec: Element, scene: Scene, awake: bool) -> dict[str, Element]:
    """Add the free bodies, each inside of what it hangs from; fixed ones are the world's body.

    Args:
        spec: what they are added to.
        scene: has them and their joints.
        awake: whether they never sleep, since a tool may pull any of them.

    Returns:
        the spec's body for each rigid body of the scene, by name.
    """
    bearers = {body.name: spec.worldbody for body in scene.bodies if body.fixed}
    tops: dict[str | None, Element] = {}  # of what hangs together
    hung = {placed.joint.body: placed.joint for placed in scene.ordered_joints}
    bonded = {name for bond in scene.bonds for name in (bond.body, bond.parent)}
    loose = [body.name for body in _rigid(scene) if body.name not in hung]

    for name in (*loose, *hung):
        body = scene[name]
        joint = hung.get(name)
        parent = joint.parent if joint else None
        bearer = spec.worldbody
        pose = body.pose

        if parent is not None:
            bearer = bearers[parent]
            if parent in tops:
                pose = scene[parent].pose.inverse() @ pose

        known = name_body(scene, name)
        element = add_body(
            bearer,
            known,
            pose,
            inertia_of(body),
        )
        bearers[name] = element
        tops[name] = tops.get(parent, element)

        if joint is None:
            element.add_freejoint(name=known)
        else:
            _add_joint(
                spec,
                element,
                joint,
                known,
            )
            # A servo's load is known where nothing else could give way to it.
            if joint.drive and (parent not in tops or bearer.gravcomp > 0):
                element.gravcomp = 1.0

        moved = joint is not None and bool(joint.drive or joint.latches)
        if body.launched or moved or name in bonded or awake:
            tops[name].sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER

    return bearers


def _rigid(scene: Scene) -> list[Body]:
    """List the bodies that can move and do not bend: what bends has no collision parts."""
    return [body for body in scene.free if body.collisions]


def name_body(scene: Scene, body: str) -> str:
    """Name a body and its joint in the spec."""
    return f"body_{[known.name for known in scene.bodies].index(body)}"


def _add_joint(spec: Element, bearer: Element, joint: Joint, name: str) -> None:
    """Add a joint at whose ``start`` the body is where it is, and its servo.

    Args:
        spec: gets the servo.
        bearer: the spec's body that it moves.
        joint: what it can do.
        name: its own and its servo's.
    """
    reference = [2 * spec.option.timestep, 1.0]
    element = bearer.add_joint(
        name=name,
        type=_KINDS[joint.kind],
        axis=joint.axis,
        pos=joint.origin,
        ref=joint.start,
    )
    if joint.limited:
        element.range = [joint.lower, joint.upper]

    set_springs(element, joint)
    element.solref_limit = reference
    element.solref_friction = reference
    element.solimp_friction = HOLDS

    if joint.drive:
        element.actfrcrange = [-joint.drive.force, joint.drive.force]
        element.actgravcomp = True
        element.armature = ROTOR * joint.drive.force
        servo = spec.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT
        )
        servo.set_to_pid(kp=1.0, kv=1.0, ki=1.0, imax=joint.drive.force)


class _Place(NamedTuple):
    """Where a body's joint is in a model.

    Attributes:
        position: its slice of all positions.
        speed: its slice of all speeds.
        number: among all joints.
    """

    position: slice
    speed: slice
    number: int


class Moving:
    """Read the free bodies from a model's positions and speeds, and move what moves by itself.

    Call `launch` once, when the robot's motion begins, and `pull` before each step.

    Args:
        scene: has the bodies and their joints.
        model: compiled with `add_bodies`.

    Attributes:
        drives: those of joints.
        launched: the bodies that get a velocity when the motion begins.
        latched: the joints with latches: forces that MuJoCo does not have, to be set before each step.
    """

    def __init__(self, scene: Scene, model: Element) -> None:
        self._scene = scene
        self._names = tuple(body.name for body in _rigid(scene))
        self._softs = Softs(scene, model)

        self._places: dict[str, _Place] = {}
        for name in self._names:
            joint = model.joint(name_body(scene, name))
            position = int(joint.qposadr[0])
            speed = int(joint.dofadr[0])
            self._places[name] = _Place(
                position=slice(position, position + len(joint.qpos0)),
                speed=slice(speed, speed + len(joint.damping)),
                number=joint.id,
            )

        self._hung = scene.ordered_joints
        hung = {placed.joint.body for placed in self._hung}
        self._loose = tuple(name for name in self._names if name not in hung)
        loose = [self._places[name] for name in self._loose]
        numbers = np.arange(model.nq)
        positions = [numbers[place.position] for place in loose]
        speeds = [numbers[place.speed] for place in loose]
        self._positions = np.array(positions, dtype=int).ravel()
        self._speeds = np.array(speeds, dtype=int).ravel()

        joints = [placed.joint for placed in self._hung]
        self.drives = [joint.drive for joint in joints if joint.drive]
        self.launched = [body for body in scene.free if body.launched]
        self.latched = [joint for joint in scene.joints if joint.latches]

    def state(self, qpos: Array, qvel: Array) -> State:
        """Convert positions (..., Q) and speeds (..., V) to the free bodies' state.

        MuJoCo knows a body that hangs from another by its joint alone, so its pose is computed, parents first.
        """
        loose = state(self._loose, qpos[..., self._positions], qvel[..., self._speeds])
        if not self._hung and not self._scene.softs:
            return loose

        softs, nodes = self._softs.read(qpos, qvel)
        found = self._place_rigid(loose, qpos, qvel) | softs
        names = tuple(body.name for body in self._scene.free)
        shape = qpos.shape[:-1]
        arrays = []
        for parts in zip(*(found[name] for name in names), strict=True):
            full = [np.broadcast_to(part, (*shape, part.shape[-1])) for part in parts]
            arrays.append(np.stack(full, axis=-2))

        return State(names, *arrays, soft=nodes)

    def _place_rigid(
        self, loose: State, qpos: Array, qvel: Array
    ) -> dict[str | None, Placement]:
        """Place the rigid bodies: a parent first, then what hangs from it.

        Args:
            loose: the state of those without a joint.
            qpos: positions (..., Q).
            qvel: speeds (..., V).
        """
        found: dict[str | None, Placement] = {None: Placement.at_rest(Pose())}
        for name, pose in self._scene.places.items():
            found[name] = Placement.at_rest(pose)

        for name in self._loose:
            found[name] = loose.placement(name)

        for placed in self._hung:
            place = self._places[placed.joint.body]
            position = qpos[..., place.position]
            value, rate = _local(placed, position, qvel[..., place.speed])
            parent = found[placed.joint.parent]
            found[placed.joint.body] = placed.carry(value, rate, parent)

        return found

    def launch(self, qpos: Array, qvel: Array) -> None:
        """Give bodies their velocities.

        Args:
            qpos: positions (Q,).
            qvel: speeds (V,), which are changed; a body's angular velocity is in its own axes there.
        """
        for body in self.launched:
            place = self._places[body.name]
            turn = qpos[place.position][3:] * _BACK
            spin = rotate(turn, np.asarray(body.spin))
            qvel[place.speed] = [*body.velocity, *spin]

    def aim(self, times: Array) -> Array:
        """Sample the drives' positions at instants (S,): (S, D)."""
        positions = np.array([drive.sample(times) for drive in self.drives])
        shape = (len(self.drives), len(times))
        return positions.reshape(shape).T

    def pull(self, model: Element, data: Element) -> None:
        """Set the forces of latches for the next step.

        Where one rises it is a spring, which is stable however stiff: MuJoCo takes its springs at the step's end. So
        the rise goes to the joint's stiffness, and what that adds away from its rest is taken off again.
        """
        for joint in self.latched:
            place = self._places[joint.body]
            position = float(data.qpos[place.position][0])
            rise = 0.0
            for latch in joint.latches:
                away = position - latch.at
                if abs(away) < latch.width / 2:
                    turn = math.pi / latch.width
                    rise += latch.force * turn * math.cos(turn * away)

            spring = rise * (position - joint.rest)
            model.jnt_stiffness[place.number] = joint.stiffness + rise
            data.qfrc_applied[place.speed] = latch_force(joint, position) + spring


def _local(placed: PlacedJoint, qpos: Array, qvel: Array) -> tuple[Array, Array]:
    """Convert a joint's positions and speeds to those of `PlacedJoint.carry`; MuJoCo's ball turns in its own axes.

    Args:
        placed: the joint.
        qpos: (..., 1), or a ball's quaternion (..., 4).
        qvel: (..., 1), or a ball's angular velocity (..., 3).
    """
    if placed.joint.kind != "ball":
        return qpos[..., 0], qvel[..., 0]

    turn = multiply(placed.turn, qpos)
    return multiply(turn, placed.turn * _BACK), rotate(turn, qvel)


def state(names: tuple[str, ...], qpos: Array, qvel: Array) -> State:
    """Convert the positions (..., 7 B) and speeds (..., 6 B) of bodies without a joint to a state.

    MuJoCo has their angular velocities in their own axes, and a state in the world's.
    """
    shape = (*qpos.shape[:-1], len(names))
    poses = qpos.reshape(*shape, 7)
    speeds = qvel.reshape(*shape, 6)
    turning = speeds[..., 3:].copy()  # in the body's own axes
    if turning.size:
        quaternions = poses[..., 3:].reshape(-1, 4)
        axes = Rotation.from_quat(quaternions, scalar_first=True)
        turned = axes.apply(turning.reshape(-1, 3))
        turning = turned.reshape(turning.shape)

    return State(
        names,
        poses[..., :3].copy(),
        poses[..., 3:].copy(),
        speeds[..., :3].copy(),
        turning,
    )
