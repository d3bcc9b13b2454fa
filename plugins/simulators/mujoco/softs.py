"""Add soft bodies to a MuJoCo spec as flexes, and read their nodes."""

from __future__ import annotations

import numpy as np

from core.errors import UserError
from core.geometry import Array
from core.scene import Scene, Soft, State
from core.values.softs import lattice, sizes
from plugins.simulators.mujoco.contacts import (
    IMPEDANCE,
    Role,
    is_discrete,
    mean_friction,
)
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.robot import HOLDS
from plugins.simulators.mujoco.shapes import Element

ITERATIONS = 500  # of the step's solver: stiff flexes need more than the usual 100
# What a cloth resists: stretching, or bending too.
_STRETCHES = 2
_BOTH = 3


def add_softs(spec: Element, scene: Scene, tools_friction: float) -> None:
    """Add each node that is not pinned as a body that slides along the world's axes, and the flexes.

    Raises:
        UserError: bodies bounce, for which MuJoCo needs an integrator that has no soft bodies.
    """
    if scene.softs:
        spec.option.iterations = ITERATIONS
        if not is_discrete(spec.option):
            raise UserError(
                "a scene with soft bodies can't have two bodies with restitution; leave it out of one"
            )
    reference = [2 * spec.option.timestep, 1.0]
    for number, soft in enumerate(scene.softs):
        names = []
        vertices = []
        for node, (place, share) in enumerate(
            zip(soft.placed, soft.form.weights, strict=True)
        ):
            pinned = node in soft.pinned
            names.append("world" if pinned else _name(number, node))
            vertices.append(place if pinned else np.zeros(3))
            if not pinned:
                mass = soft.mass * share
                body = spec.worldbody.add_body(
                    name=names[-1], pos=place, mass=mass, inertia=[1e-4 * mass] * 3
                )
                body.explicitinertial = True
                for axis, way in enumerate(np.eye(3)):
                    body.add_joint(
                        name=f"{names[-1]}/{axis}",
                        type=mujoco.mjtJoint.mjJNT_SLIDE,
                        axis=way,
                    )
        flex = spec.add_flex(
            name=f"soft/{soft.name}", dim=soft.form.elements.shape[1] - 1
        )
        flex.vertbody = names
        flex.vert = np.ravel(vertices)
        flex.elem = np.ravel(soft.form.elements).astype(np.int32)
        flex.radius = soft.form.thickness / 2
        flex.young = soft.elastic.young
        flex.poisson = soft.elastic.poisson
        flex.damping = max(
            soft.elastic.damping, 1e-9
        )  # MuJoCo warns of a solid without any
        flex.contype, flex.conaffinity = Role.SCENE.value
        flex.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_NONE
        # Above that of fixed geoms.
        flex.condim = 3
        flex.priority = 2
        flex.friction = [mean_friction(soft.friction, tools_friction), 0.0, 0.0]
        flex.solref = [reference[0], 1.3]
        flex.solimp = IMPEDANCE
        # Neo-Hookean: MuJoCo's other material, Saint Venant-Kirchhoff's, folds up under loads.
        flex.elastic3d = int(soft.form.kind == "solid")
        if soft.form.kind == "cloth":
            flex.thickness = soft.form.thickness
            flex.elastic2d = (
                _BOTH if _bends(soft, -spec.option.gravity[2]) else _STRETCHES
            )
        if soft.form.kind == "rope":
            length = spec.add_equality(type=mujoco.mjtEq.mjEQ_FLEX, name1=flex.name)
            length.solref = reference
            length.solimp = HOLDS


def hull_boxes(spec: Element) -> None:
    """Make all boxes convex meshes: a cloth and the middle of a box's edge don't touch, its triangles and a mesh do."""
    for geom in spec.geoms:
        if geom.type == mujoco.mjtGeom.mjGEOM_BOX:
            mesh = f"mesh_{len(spec.meshes)}"
            spec.add_mesh(name=mesh, uservert=np.ravel(lattice((2, 2, 2)) * geom.size))
            geom.type = mujoco.mjtGeom.mjGEOM_MESH
            geom.meshname = mesh
            geom.size = np.zeros(3)


def _bends(soft: Soft, gravity: float) -> bool:
    """Check if a cloth's own weight bends it over more than a cell; else its stiffness in bending is left out, which
    costs as much as all the rest."""
    elastic = soft.elastic
    thickness = soft.form.thickness
    stiff = (
        elastic.young
        * thickness**2
        / (12 * elastic.density * gravity * (1 - elastic.poisson**2))
    )
    cell: float = np.median(sizes(soft.form.nodes, soft.form.elements))
    return bool(stiff ** (1 / 3) > np.sqrt(2 * cell))


def _name(number: int, node: int) -> str:
    return f"soft_{number}/{node}"


class Softs:
    """Where soft bodies' nodes are among a model's positions and speeds."""

    def __init__(self, scene: Scene, model: Element) -> None:
        self._scene = scene
        self._places = list[tuple[list[int], list[int], list[int]]]()
        for number, soft in enumerate(scene.softs):
            free = [
                node for node in range(len(soft.form.nodes)) if node not in soft.pinned
            ]
            joints = [
                model.joint(f"{_name(number, node)}/{axis}")
                for node in free
                for axis in range(3)
            ]
            addresses = (
                [int(joint.qposadr[0]) for joint in joints],
                [int(joint.dofadr[0]) for joint in joints],
            )
            self._places.append((free, *addresses))

    def joined(self, rigid: State, qpos: Array, qvel: Array) -> State:
        """Put the soft bodies, from positions (..., Q) and speeds (..., V), among a state of the rigid ones."""
        if not self._scene.softs:
            return rigid
        shape = qpos.shape[:-1]
        nodes = {}
        found = {
            name: [array[..., k, :] for array in rigid.arrays]
            for k, name in enumerate(rigid.names)
        }
        for soft, (free, at, speeds) in zip(
            self._scene.softs, self._places, strict=True
        ):
            moved, moving = np.zeros((2, *shape, len(soft.form.nodes), 3))
            moved[..., free, :] = qpos[..., at].reshape(*shape, -1, 3)
            moving[..., free, :] = qvel[..., speeds].reshape(*shape, -1, 3)
            nodes[soft.name] = soft.placed + moved
            middle = soft.form.weights @ nodes[soft.name]
            speed = soft.form.weights @ moving
            upright = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*shape, 4))
            found[soft.name] = [middle, upright, speed, np.zeros_like(speed)]
        names = tuple(body.name for body in self._scene.free)
        arrays = (
            np.stack(parts, axis=-2)
            for parts in zip(*(found[name] for name in names), strict=True)
        )
        return State(names, *arrays, soft=nodes)
