"""What touches what, and how a contact behaves.

MuJoCo gives a contact the larger of two geoms' friction coefficients, and one rate at which it stops both penetration
and slip. Ours has the geometric mean, and stops slip more slowly. An explicit pair of geoms can have both, but is
tested at every step; so only those are made that need be: of all that can move freely, and of the arm's links where
their friction is not the tool's.

Why slip is stopped slowly: MuJoCo's contacts solve a convex problem, in which what slips at a speed v is also pushed
off the surface, by friction times v times the share of the slip that is stopped within a step. At the rate that suits
penetration, most of it is, and a box that slides at 1 m/s hops by a centimetre. Rolling friction counts turning as
slip, of which a ball has much for as long as it rolls, so that it hops all the way: there slip is stopped more slowly
still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from scipy.optimize import brentq

from core.robot.description import TOOL_FRICTION
from plugins.simulators.mujoco.engine import mujoco
from plugins.simulators.mujoco.shapes import Element

# How much of an unwanted acceleration a contact cancels, at the surface and from a penetration of 1 mm on.
_IMPEDANCE = [0.95, 0.99, 0.001, 0.5, 2.0]
_REBOUND_STEPS = 10  # that a contact lasts in which something bounces: fewer, and the rebound is wrong by a tenth
_MOST_DAMPED = 0.99  # the damping ratio of such a contact, at most; 1 still throws back with 0.135 of the speed
_ROLLING_SHARE = 0.25  # of the slip rate, where there is rolling friction


class Role(Enum):
    """A geom's (contype, conaffinity): two touch if the one's type is among the other's affinities."""

    SCENE = (1, 15)
    ARM = (2, 0)  # its own links overlap by construction and never touch each other
    TOOL = (4, 7)  # what is mounted touches all but its bearer
    BEARER = (8, 0)


@dataclass(frozen=True)
class Surface:
    """Of a body: friction coefficient, arm of its rolling friction in metres, restitution."""

    friction: float
    rolling: float = 0.0
    restitution: float = 0.0


@dataclass(frozen=True, eq=False)
class Felt:
    """A geom that is felt. ``bearer`` is the name of the spec's body that it is on."""

    geom: Element
    bearer: str
    role: Role
    surface: Surface
    free: bool = False  # part of a body that can move freely


def bounces(surfaces: Sequence[Surface]) -> bool:
    """Whether anything can bounce off anything: restitution is a product, so it takes two."""
    return sum(surface.restitution > 0 for surface in surfaces) > 1


def set_contacts(spec: Element, felt: Sequence[Felt], slip_rate: float) -> None:
    """Say of each geom and of each pair that needs it how its contacts behave.

    Each pair is looked at in every step, so there is none for what can't move and a tool: such geoms have what comes of
    their friction and the tool's, and their say goes.
    """
    tools = next((one.surface.friction for one in felt if one.role is Role.TOOL), TOOL_FRICTION)
    met = [tools if one.role is Role.SCENE else one.surface.friction for one in felt]  # that need no pair with it
    reference = [2 * spec.option.timestep, 1.3]  # as stiff as the time step allows, and damped so that nothing rebounds
    for number, one in enumerate(felt):
        geom = one.geom
        geom.name = f"geom_{number}"
        geom.contype, geom.conaffinity = one.role.value
        friction = one.surface.friction
        if one.role is Role.SCENE and not one.free:
            friction, geom.priority = _mean(friction, tools), 1
        geom.friction = [friction, 0.0, one.surface.rolling]
        geom.condim = _dimensions(one.surface.rolling)
        geom.solref, geom.solimp = reference, _IMPEDANCE
    covered = set()
    for number, one in enumerate(felt):
        for later, other in enumerate(felt[number + 1 :], start=number + 1):
            free = one.free or other.free
            if one.bearer == other.bearer or not _touch(one.role, other.role):
                continue
            if not free and met[number] == met[later]:
                continue
            friction = _mean(one.surface.friction, other.surface.friction)
            rolling = max(one.surface.rolling, other.surface.rolling)
            spec.add_pair(
                geomname1=one.geom.name,
                geomname2=other.geom.name,
                condim=_dimensions(rolling),
                friction=[friction, friction, 0.0, rolling, rolling],
                solref=_rebound(spec, one.surface.restitution * other.surface.restitution) or reference,
                # Stiffness, which friction has none of, and damping.
                solreffriction=[-1.0, -slip_rate * (_ROLLING_SHARE if rolling > 0 else 1.0)],
                solimp=_IMPEDANCE,
            )
            if free and (one.bearer, other.bearer) not in covered:  # all their pairs are explicit
                covered.add((one.bearer, other.bearer))
                spec.add_exclude(bodyname1=one.bearer, bodyname2=other.bearer)


def _touch(one: Role, other: Role) -> bool:
    (type_1, affinity_1), (type_2, affinity_2) = one.value, other.value
    return bool(type_1 & affinity_2 or type_2 & affinity_1)


def _mean(one: float, other: float) -> float:
    return float(np.sqrt(one * other))


def _dimensions(rolling: float) -> int:
    """Of a contact: the normal and two of slip, and with rolling friction three of turning."""
    return 6 if rolling > 0 else 3


def _rebound(spec: Element, restitution: float) -> list[float] | None:
    """A spring and a damper, as MuJoCo takes them, that throw back with a share of the speed; None for hardly any."""
    if restitution <= _returned(_MOST_DAMPED):
        return None
    ratio = brentq(lambda z: _returned(z) - min(restitution, 1.0), 0.0, _MOST_DAMPED)
    frequency = np.pi / (_REBOUND_STEPS * spec.option.timestep)
    return [-(frequency**2), -2 * ratio * frequency]


def _returned(ratio: float) -> float:
    """The share of its speed with which something leaves a spring of a damping ratio below 1 that can't hold it back.

    T. Schwager and T. Poeschel, "Coefficient of restitution and linear-dashpot model revisited", Granular Matter 9
    (2007): contact ends when the force does, before the spring is as long again as it was.
    """
    swing = np.sqrt(1 - ratio**2)
    return float(np.exp(-ratio / swing * (np.pi - np.arctan2(2 * ratio * swing, swing**2 - ratio**2))))


def options(spec: Element, time_step: float, gravity: float, *, bouncing: bool) -> None:
    """How the world is solved and stepped."""
    option = spec.option
    option.timestep = time_step
    option.gravity = [0.0, 0.0, -gravity]
    # Servos are stiff against the arm's inertia. Only this integrator lets contacts know how stiff: with the others
    # what the arm carries is given accelerations that the arm then doesn't have, and creeps. It is also implicit in
    # the contacts' springs, which takes the rebound out of what is to bounce.
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST if bouncing else mujoco.mjtIntegrator.mjINT_DISCRETE
    # Pyramids would be faster, but hold less across their corners, and can't have a slip rate of their own.
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 10.0  # friction gives way ten times less than the surface: what is held does not creep
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE  # the same numbers as dense, and with 30 spheres 40 times faster
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP  # what lies still is left alone until something touches it
    option.sleep_tolerance = 2.5e-4  # m/s for ten steps; with its own a ball on a slope of 0.1 degrees never starts
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_FILTERPARENT  # a tool may touch the link before its bearer
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # a world that explodes is not put back to its start
