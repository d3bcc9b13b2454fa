"""Check the joints of a tool: number, ranges, what holds their two sides together, springs and dampers.

An engine's step is 2 to 5 ms. A spring or a damper that acts faster than that shakes or explodes in some engines. How
strong springs may be follows from springs that one can buy or print; `docs/materials.md` has the sources.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Bearer, DesignError, Tool, ToolJoint
from core.geometry import Array, Pose, mass_properties
from core.robot.solids import Solid, signed_distance, solid_geometry
from core.values.materials import Material

MAX_JOINTS = 8
MAX_TURN_RAD = 2 * math.pi
MAX_SLIDE_M = 0.5
MIN_RANGE = {"hinge": 0.01, "slider": 0.0005}  # radians, metres; an engine takes a range of next to nothing for none
MIN_MOVED_KG = 0.001
MAX_HZ = 20.0  # of what a spring moves, on its own
MAX_DECAY = 100.0  # 1/s, at which a damper stops what it moves
MAX_SPRING = {"hinge": 3.0, "slider": 50.0}  # N m and N, of a bought spring or brake of a hand tool's size
MAX_SPRINGS_J = 2.0  # of all bought springs of a tool
PRINTED_M3 = 20e-6  # of material, from which the springs of a tool are made
MAX_DAMPING = {"hinge": 0.2, "slider": 20.0}  # N m s/rad and N s/m, of a bought damper of that size
MAX_GAP_M = 0.001  # between a component and its parent
_UNITS = {"hinge": ("rad", "N m", "N m s/rad"), "slider": ("m", "N", "N s/m")}
_STEP_M, _FEWEST, _MOST = 0.005, 9, 201  # between places in which the two sides of a joint must touch; their number


def spring_share(material: Material) -> float:
    """Compute which share of a bought spring's energy, torque and force springs of a material may have.

    A bent spring of rectangular section holds a ninth of what its volume would at its strength. Where the material has
    no strength, springs are bought.
    """
    if material.strength_pa is None:
        return 1.0
    return min(1.0, PRINTED_M3 * material.strength_pa**2 / (18 * material.young_pa) / MAX_SPRINGS_J)


def describe_springs(material: Material) -> str:
    """Write the part of a prompt that says how strong springs and dampers of joints may be."""
    share = spring_share(material)
    torque, force, energy = (share * most for most in (*MAX_SPRING.values(), MAX_SPRINGS_J))
    turning, sliding = MAX_DAMPING.values()
    return (
        f"At the end of its range that is farther from `rest` a spring exerts {torque:.2g} N m or {force:.2g} N at "
        f"most;\n  all together hold {energy:.2g} J at most. Damping is at most {turning:g} N m s/rad or {sliding:g} "
        f"N s/m,\n  dry friction {MAX_SPRING['hinge']:g} N m or {MAX_SPRING['slider']:g} N"
    )


def check_joints(tool: Tool, material: Material, mounts: Mapping[str, Sequence[Solid]]) -> None:
    """Check the joints of a tool; ``mounts`` are the solids of what it hangs from, each in its own frame.

    Raises:
        DesignError: the first rule that is broken.
    """
    if len(tool.bearers) > MAX_JOINTS:
        raise DesignError(f"the tool has {len(tool.bearers)} moving joints; at most {MAX_JOINTS} are allowed")
    share, energies = spring_share(material), dict[str, float]()
    for bearer in tool.bearers:
        joint, where = bearer.joint, f"the joint of component {bearer.name!r}"
        _check_range(joint, where)
        _check_motion(tool, bearer, where)
        unit, pull, resists = _UNITS[joint.kind]
        strain = max(abs(joint.lower - joint.rest), abs(joint.upper - joint.rest))
        exerted, most = joint.stiffness * strain, share * MAX_SPRING[joint.kind]
        if exerted > most:
            raise DesignError(
                f"{where} has too strong a spring: it exerts {exerted:.3g} {pull} where it is {strain:.3g} {unit} from "
                f"its rest; at most {most:.2g} {pull} are allowed"
            )
        resisting = ("damping", joint.damping, MAX_DAMPING, resists), ("dry friction", joint.friction, MAX_SPRING, pull)
        for what, value, limits, shown in resisting:
            if value > (most := limits[joint.kind]):
                raise DesignError(f"{where} has a {what} of {value:.3g} {shown}; at most {most:g} is allowed")
        energies[bearer.name] = exerted * strain / 2
    if (energy := sum(energies.values())) > (most := share * MAX_SPRINGS_J):
        strongest = max(energies, key=lambda name: energies[name])
        raise DesignError(
            f"the tool's springs hold {energy:.3g} J at the ends of their ranges; at most {most:.2g} J are allowed: "
            f"give {strongest!r} a smaller range or a softer spring"
        )
    _check_touch(tool, mounts)


def _check_range(joint: ToolJoint, where: str) -> None:
    most, unit = MAX_TURN_RAD if joint.kind == "hinge" else MAX_SLIDE_M, _UNITS[joint.kind][0]
    if max(-joint.lower, joint.upper) > most:
        raise DesignError(f"{where} goes from {joint.lower:g} to {joint.upper:g} {unit}; at most {most:.3g} is allowed")
    if joint.upper - joint.lower < (least := MIN_RANGE[joint.kind]):
        raise DesignError(
            f"{where} goes from {joint.lower:g} to {joint.upper:g} {unit}; give it a range of {least:g} or more, or no "
            "joint"
        )
    if not -most <= joint.rest <= most:
        raise DesignError(f"{where} has a spring that is relaxed at {joint.rest:g} {unit}; at most {most:.3g}")


def _check_motion(tool: Tool, bearer: Bearer, where: str) -> None:
    """Refuse what moves too fast for an engine's steps."""
    joint, (mass, inertia) = bearer.joint, moved(tool, bearer)
    if mass < MIN_MOVED_KG:
        raise DesignError(f"{where} moves {mass:.2g} kg; at least {MIN_MOVED_KG:g} kg is needed")
    hertz, decay = math.sqrt(joint.stiffness / inertia) / (2 * math.pi), joint.damping / inertia
    if hertz > MAX_HZ:
        raise DesignError(
            f"{where} has too stiff a spring: what it moves would swing at {hertz:.0f} Hz, and at most {MAX_HZ:g} "
            f"can be simulated; a stiffness of {joint.stiffness * (MAX_HZ / hertz) ** 2:.2g} would do, or more mass"
        )
    if decay > MAX_DECAY:
        raise DesignError(
            f"{where} has too much damping: {joint.damping:g} for an inertia of {inertia:.2g}; at most "
            f"{MAX_DECAY * inertia:.2g} can be simulated; for more resistance give friction"
        )


def moved(tool: Tool, bearer: Bearer) -> tuple[float, float]:
    """Compute the mass (kg) of what moves on a joint as one, and its inertia about a hinge's axis (kg m^2); of a
    slider the mass again.

    What hangs on a further joint is left out: it need not follow.
    """
    joint, mass, inertia = bearer.joint, 0.0, 0.0
    axis: Array = np.array(joint.axis)
    for component in tool.components:
        own, pose = tool.borne[component.name]
        if own != bearer.name:
            continue
        center, tensor = mass_properties(component.shape, component.mass)
        turned = pose.rotation.inv().apply(axis)
        away: Array = np.cross(axis, pose.apply(center))
        mass += component.mass
        inertia += float(turned @ tensor @ turned + component.mass * (away @ away))
    return mass, inertia if joint.kind == "hinge" else mass


def _check_touch(tool: Tool, mounts: Mapping[str, Sequence[Solid]]) -> None:
    """Refuse a joint whose two sides come apart within its range: what joins them there must be a solid of one."""
    sides = {name: list(mounts.get(name, ())) for name in tool.borne_on}
    for part in tool.parts:
        sides[part.bearer].append(Solid(part.component, solid_geometry(part.shape), part.pose))
    for name, parent, frame, joint in tool.bearers:
        lever = 1.0 if joint.kind == "slider" else max(_reach(solid) for solid in sides[name])
        count = np.clip((joint.upper - joint.lower) * lever / _STEP_M, _FEWEST, _MOST)
        near: tuple[Solid, Solid] | None = None  # the two that touched last
        for value in np.linspace(joint.lower, joint.upper, int(count)).tolist():
            place = frame @ _moved_by(joint, value)
            if near is not None and _gap(*near, place) <= MAX_GAP_M:
                continue
            pairs = itertools.product(sides[parent], sides[name])
            near = next((pair for pair in pairs if _gap(*pair, place) <= MAX_GAP_M), None)
            if near is None:
                raise DesignError(
                    f"component {name!r} leaves what bears it, {parent!r}, where its joint is at {value:.3g} "
                    f"{_UNITS[joint.kind][0]}: shorten the range, or add a rail that goes on touching"
                )


def _moved_by(joint: ToolJoint, value: float) -> Pose:
    """The pose of a joint's link at a value, in its frame at 0."""
    way = value * np.array(joint.axis)
    return Pose(way) if joint.kind == "slider" else Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(way))


def _gap(still: Solid, moving: Solid, place: Pose) -> float:
    return signed_distance(still, replace(moving, pose=place @ moving.pose))


def _reach(solid: Solid) -> float:
    """How far a solid extends from the origin of its frame, at most, metres."""
    center, half = solid.bounds()
    return float(np.linalg.norm(np.abs(center) + half))
