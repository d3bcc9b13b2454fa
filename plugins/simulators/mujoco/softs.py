"""Add soft bodies to a MuJoCo spec as flexes, and read their nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from core.errors import UserError
from core.geometry import Array
from core.scene import Scene, Soft
from core.values.joints import Placement
from core.values.softs import lattice
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
STIFF = 4.0  # a cloth's contacts: per time step squared
DAMPED = 2.0  # per time step
_AXES = 3  # along which a node slides
# What a cloth resists: stretching, or bending too.
_STRETCHES = 2
_BOTH = 3


def add_softs(spec: Element, scene: Scene, tools_friction: float) -> None:
    """Add each node that is not pinned as a body that slides along the world's axes, and the flexes.

    Args:
        spec: what they are added to.
        scene: has the soft bodies.
        tools_friction: the coefficient of what may touch them.

    Raises:
        UserError: bodies bounce, for which MuJoCo needs an integrator that has no soft bodies.
    """
    if not scene.softs:
        return

    spec.option.iterations = ITERATIONS
    if not is_discrete(spec.option):
        raise UserError(
            "a scene with soft bodies can't have two bodies with restitution; leave it out of one"
        )

    for number, soft in enumerate(scene.softs):
        flex = _add_flex(spec, number, soft)
        _set_contact(spec, flex, mean_friction(soft.friction, tools_friction))
        _set_elastic(spec, flex, soft)


def _add_flex(spec: Element, number: int, soft: Soft) -> Element:
    """Add a soft body's nodes, and the flex that they are the vertices of.

    Args:
        spec: what they are added to.
        number: the body's, among the soft ones.
        soft: the body.
    """
    form = soft.form
    bearers = ["world"] * len(soft.placed)
    # Of nodes that are pinned in the world, of others in their body.
    vertices = soft.placed.copy()
    for node in _free_nodes(soft):
        bearers[node] = _name(number, node)
        mass = soft.mass * form.weights[node]
        _add_node(
            spec,
            bearers[node],
            vertices[node],
            mass,
        )
        vertices[node] = 0.0

    flex = spec.add_flex(name=f"soft/{soft.name}", dim=form.elements.shape[1] - 1)
    flex.vertbody = bearers
    flex.vert = np.ravel(vertices)
    flex.elem = np.ravel(form.elements).astype(np.int32)
    flex.radius = form.thickness / 2
    return flex


def _add_node(spec: Element, name: str, place: Array, mass: float) -> None:
    """Add a node of a mass, kg, at a place (3,) in the world."""
    body = spec.worldbody.add_body(
        name=name,
        pos=place,
        mass=mass,
        inertia=[1e-4 * mass] * 3,
        explicitinertial=True,
    )
    for axis, way in enumerate(np.eye(_AXES)):
        body.add_joint(
            name=f"{name}/{axis}",
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=way,
        )


def _set_contact(spec: Element, flex: Element, friction: float) -> None:
    """Let a flex touch the scene and the tool, with a coefficient of friction, but not itself."""
    flex.contype, flex.conaffinity = Role.SCENE.value
    flex.selfcollide = mujoco.mjtFlexSelf.mjFLEXSELF_NONE
    flex.condim = 3
    flex.priority = 2  # above that of fixed geoms
    flex.friction = [friction, 0.0, 0.0]
    flex.solref = [2 * spec.option.timestep, 1.3]
    flex.solimp = IMPEDANCE


def _set_elastic(spec: Element, flex: Element, soft: Soft) -> None:
    """Set what a flex resists with: stretching, bending and damping."""
    flex.young = soft.elastic.young
    flex.poisson = soft.elastic.poisson
    # MuJoCo warns of a solid without any.
    flex.damping = max(soft.elastic.damping, 1e-9)

    match soft.form.kind:
        case "solid":
            # Neo-Hookean: MuJoCo's other material, Saint Venant-Kirchhoff's, folds up under loads.
            flex.elastic3d = 1

        case "cloth":
            # Triangles that share nodes make a contact as soft as many; at the usual rate a cloth sinks by 2 mm.
            step = spec.option.timestep
            flex.solref = [-STIFF / step**2, -DAMPED / step]
            flex.thickness = soft.form.thickness
            flex.elastic2d = _STRETCHES
            if _bends(soft, float(np.linalg.norm(spec.option.gravity))):
                flex.elastic2d = _BOTH

        case "rope":
            length = spec.add_equality(type=mujoco.mjtEq.mjEQ_FLEX, name1=flex.name)
            length.solref = [2 * spec.option.timestep, 1.0]
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
    """Check if a cloth's own weight bends it over more than a cell; ``gravity``: m/s^2.

    Else its stiffness in bending is left out, which costs as much as all the rest.
    """
    elastic = soft.elastic
    thickness = soft.form.thickness
    weight = 12 * elastic.density * gravity * (1 - elastic.poisson**2)
    stiff = elastic.young * thickness**2 / weight
    cell: float = np.median(soft.form.sizes)
    return bool(stiff ** (1 / 3) > np.sqrt(2 * cell))


def _free_nodes(soft: Soft) -> list[int]:
    """List the nodes that are not pinned."""
    return [node for node in range(len(soft.form.nodes)) if node not in soft.pinned]


def _name(number: int, node: int) -> str:
    """Name a node's body in the spec."""
    return f"soft_{number}/{node}"


class _Nodes(NamedTuple):
    """A soft body's nodes that are not pinned (N,), and where their positions and speeds are (3 N,)."""

    free: list[int]
    positions: list[int]
    speeds: list[int]


class Softs:
    """Where soft bodies' nodes are among a model's positions and speeds.

    Args:
        scene: has the soft bodies.
        model: compiled with `add_softs`.
    """

    def __init__(self, scene: Scene, model: Element) -> None:
        self._softs = scene.softs
        self._places: list[_Nodes] = []
        for number, soft in enumerate(scene.softs):
            nodes = _Nodes(_free_nodes(soft), [], [])
            for node in nodes.free:
                for axis in range(_AXES):
                    joint = model.joint(f"{_name(number, node)}/{axis}")
                    nodes.positions.append(int(joint.qposadr[0]))
                    nodes.speeds.append(int(joint.dofadr[0]))

            self._places.append(nodes)

    def read(
        self, qpos: Array, qvel: Array
    ) -> tuple[dict[str, Placement], dict[str, Array]]:
        """Read the soft bodies from positions (..., Q) and speeds (..., V).

        Returns:
            the placement of each, in which its middle never turns, and its nodes (..., N, 3), by name.
        """
        shape = qpos.shape[:-1]
        placements = {}
        nodes = {}
        for soft, place in zip(self._softs, self._places, strict=True):
            moved = np.zeros((*shape, len(soft.form.nodes), 3))
            moving = np.zeros_like(moved)
            free = (*shape, -1, 3)
            moved[..., place.free, :] = qpos[..., place.positions].reshape(free)
            moving[..., place.free, :] = qvel[..., place.speeds].reshape(free)

            nodes[soft.name] = soft.placed + moved
            speed = soft.form.weights @ moving
            placements[soft.name] = Placement(
                soft.form.weights @ nodes[soft.name],
                np.array([1.0, 0.0, 0.0, 0.0]),
                speed,
                np.zeros_like(speed),
            )

        return placements, nodes
