"""Define which geoms touch, and how their contacts behave.

MuJoCo gives a contact the larger of two geoms' friction coefficients, and one rate at which it stops both penetration
and slip. Ours has the geometric mean, and stops slip more slowly. An explicit pair of geoms can have both, but is
tested at every step. So pairs are made only where needed: for free bodies, and for the arm's links where their friction
differs from the tool's.

Slip is stopped slowly because of MuJoCo's convex contact model: a body that slips at a speed v is also pushed off the
surface, by friction times v times the share of the slip that is stopped within a step. At the rate that suits
penetration, most of it is, and a box that slides at 1 m/s hops by a centimetre. Rolling friction counts rotation as
slip. A rolling ball has much of it all the time and would hop all the way, so there slip is stopped more slowly still.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from enum import Enum
from itertools import combinations

import numpy as np
from scipy.optimize import brentq

from core.geometry import Vector
from core.values.robots import LINK_FRICTION
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

# The share of an unwanted acceleration that a contact cancels, at the surface and from a penetration of 1 mm on.
IMPEDANCE = [0.95, 0.99, 0.001, 0.5, 2.0]
_REBOUND_STEPS = 10  # time steps of a contact that bounces; with fewer, the rebound is wrong by a tenth
_MOST_DAMPED = 0.99  # largest damping ratio of such a contact; at 1 it still returns 0.135 of the speed
_ROLLING_SHARE = 0.25  # of the slip rate, where there is rolling friction


class Role(Enum):
    """A geom's (contype, conaffinity): two touch if one's type is among the other's affinities."""

    SCENE = (1, 15)
    ARM = (2, 0)  # its own links overlap by construction and never touch each other
    TOOL = (4, 7)  # touches everything but the link that bears it
    BEARER = (8, 0)

    def meets(self, other: Role) -> bool:
        """Check if geoms of these roles touch."""
        kind, affinity = self.value
        others_kind, others_affinity = other.value
        return bool(kind & others_affinity or others_kind & affinity)


@dataclass(frozen=True)
class Surface:
    """What a body's contacts depend on.

    Attributes:
        friction: its coefficient; two bodies have the geometric mean.
        rolling: the arm of rolling friction, m; two bodies have the larger.
        restitution: the share of speed that is left; two bodies have the product.
    """

    friction: float
    rolling: float = 0.0
    restitution: float = 0.0


@dataclass(frozen=True, eq=False)
class Collider:
    """A geom that collides.

    Attributes:
        geom: of the spec.
        owner: what it is part of: a scene's body, a link of the arm, or ``tool``.
        bearer: the name of its body in the spec.
        role: what it touches.
        surface: what its contacts depend on.
        free: whether it is part of a body that can move freely.
    """

    geom: Element
    owner: str
    bearer: str
    role: Role
    surface: Surface
    free: bool = False

    def partners_friction(self, tools: float) -> float:
        """The friction coefficient that a partner must have so that their contact needs no pair."""
        if self.role is Role.SCENE:
            return tools
        return self.surface.friction


def bounces(surfaces: Sequence[Surface]) -> bool:
    """Check if any two bodies can bounce: restitution is a product, so it takes two."""
    return sum(surface.restitution > 0 for surface in surfaces) > 1


def set_contacts(
    spec: Element,
    colliders: Sequence[Collider],
    slip_rate: float,
    joined: Set[frozenset[str]] = frozenset(),
) -> None:
    """Set the contact parameters of each geom, and add the pairs that are needed, without those of ``joined`` bodies.

    Each pair costs time in every step, so there are none of fixed geoms with the tool. Instead a fixed geom carries the
    mean of its own friction and the tool's, and has priority.

    Args:
        spec: what the geoms are in.
        colliders: all geoms that collide.
        slip_rate: how fast friction stops slow slip, 1/s.
        joined: pairs of the scene's bodies that never touch, by name.
    """
    tools = tools_friction(colliders)
    for number, collider in enumerate(colliders):
        _set_contact(spec, collider, number, tools)
    covered = set()
    for first, second in combinations(colliders, 2):
        if first.bearer == second.bearer or not first.role.meets(second.role):
            continue
        free = first.free or second.free
        needed = first.partners_friction(tools)
        if not free and needed == second.partners_friction(tools):
            continue

        bearers = (first.bearer, second.bearer)
        if free and bearers not in covered:  # all their pairs are explicit
            covered.add(bearers)
            spec.add_exclude(bodyname1=first.bearer, bodyname2=second.bearer)

        in_scene = first.role is second.role is Role.SCENE
        if in_scene and frozenset((first.owner, second.owner)) in joined:
            continue
        _add_pair(spec, first, second, slip_rate)


def _reference(spec: Element) -> list[float]:
    """Return what is as stiff as the time step allows, and damped so that nothing rebounds."""
    return [2 * spec.option.timestep, 1.3]


def _set_contact(spec: Element, collider: Collider, number: int, tools: float) -> None:
    """Set what a geom has where no pair says it."""
    geom = collider.geom
    geom.name = f"{number}/{collider.owner}"
    geom.contype, geom.conaffinity = collider.role.value
    friction = collider.surface.friction
    if collider.role is Role.SCENE and not collider.free:
        friction = mean_friction(friction, tools)
        geom.priority = 1
    rolling = collider.surface.rolling
    geom.friction = [friction, rolling, rolling]
    geom.condim = _dimensions(collider.surface.rolling)
    geom.solref = _reference(spec)
    geom.solimp = IMPEDANCE


def _add_pair(
    spec: Element, first: Collider, second: Collider, slip_rate: float
) -> None:
    """Add a pair of geoms with parameters of its own."""
    friction = mean_friction(first.surface.friction, second.surface.friction)
    rolling = max(first.surface.rolling, second.surface.rolling)
    if rolling > 0:
        slip_rate *= _ROLLING_SHARE
    restitution = first.surface.restitution * second.surface.restitution
    spec.add_pair(
        geomname1=first.geom.name,
        geomname2=second.geom.name,
        condim=_dimensions(rolling),
        friction=[friction, friction, rolling, rolling, rolling],
        solref=_rebound(spec, restitution) or _reference(spec),
        # Stiffness, which friction has none of, and damping.
        solreffriction=[-1.0, -slip_rate],
        solimp=IMPEDANCE,
    )


def tools_friction(colliders: Sequence[Collider]) -> float:
    """The friction coefficient of the tool, or without one of the links."""
    return next(
        (item.surface.friction for item in colliders if item.role is Role.TOOL),
        LINK_FRICTION,
    )


def mean_friction(first: float, second: float) -> float:
    """Compute the friction coefficient between two bodies: the geometric mean of theirs."""
    return float(np.sqrt(first * second))


def _dimensions(rolling: float) -> int:
    """Count a contact's dimensions: the normal, two of slip, and with rolling friction three of rotation."""
    if rolling > 0:
        return 6
    return 3


def _rebound(spec: Element, restitution: float) -> list[float] | None:
    """Make a spring and damper for MuJoCo that return ``restitution`` of the speed; None if that is hardly any."""
    if restitution <= _returned(_MOST_DAMPED):
        return None
    ratio = brentq(lambda z: _returned(z) - min(restitution, 1.0), 0.0, _MOST_DAMPED)
    frequency = np.pi / (_REBOUND_STEPS * spec.option.timestep)
    return [-(frequency**2), -2 * ratio * frequency]


def _returned(ratio: float) -> float:
    """Compute the share of speed that a spring returns which can't pull, at a damping ratio below 1.

    T. Schwager and T. Poeschel, "Coefficient of restitution and linear-dashpot model revisited", Granular Matter 9
    (2007): contact ends when the force does, before the spring has its full length again.
    """
    swing = np.sqrt(1 - ratio**2)
    phase = np.pi - np.arctan2(2 * ratio * swing, swing**2 - ratio**2)
    return float(np.exp(-ratio / swing * phase))


def is_discrete(option: Element) -> bool:
    """Check if servos compare their targets with where joints are at a step's end, not where they are before it."""
    return bool(option.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE)


def set_options(
    spec: Element, time_step: float, gravity: Vector, *, bouncing: bool
) -> None:
    """Set how the world is solved and stepped."""
    option = spec.option
    option.timestep = time_step
    option.gravity = list(gravity)
    # Servos are stiff against the arm's inertia. Only the discrete integrator takes that into account in contacts; with
    # the others, loads get accelerations that the arm does not have, and creep. But it is also implicit in the
    # contacts' springs, which removes the rebound, so bouncing bodies get the other one.
    option.integrator = mujoco.mjtIntegrator.mjINT_DISCRETE
    if bouncing:
        option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Pyramids would be faster, but hold less across their corners, and can't have a slip rate of their own.
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 10.0  # friction yields ten times less than the normal: held objects do not creep
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    # The same numbers as dense, and with 30 spheres 40 times faster.
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    # Bodies at rest are skipped until something touches them.
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    option.sleep_tolerance = 2.5e-4  # m/s for ten steps; with the default a ball on a slope of 0.1 degrees never starts
    # A tool may touch the link before its bearer.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    # A world that diverges is not reset.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
