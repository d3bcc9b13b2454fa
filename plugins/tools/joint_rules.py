"""Check the joints of a tool: that one can make them, that engines can follow them, and that they hold together."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import MAX_JOINTS, Bearer, DesignError, Tool, ToolJoint
from core.designs.rules import MAX_GAP_M, mount_solids
from core.designs.springs import bound_speeds, measure_levers, measure_lightness
from core.geometry import Array, Cylinder, Pose
from core.interfaces import Robot
from core.robot.solids import Solid, signed_distance, solid_geometry
from core.values.materials import Material
from plugins.tools.refusals import ToolReason


class JointLimits(NamedTuple):
    """What the joints of a kind may be.

    Attributes:
        unit: of a position.
        load: the unit of a torque or force.
        resistance: the unit of damping.
        most: how far from 0 a range may go, and a spring be relaxed.
        least_range: an engine takes a range of next to nothing for none.
        spring: the largest torque or force of a bought spring or brake of a hand tool's size.
        damping: of a bought damper of that size.
    """

    unit: str
    load: str
    resistance: str
    most: float
    least_range: float
    spring: float
    damping: float


# docs/materials.md has the sources.
LIMITS = {
    "hinge": JointLimits(
        "rad",
        "N m",
        "N m s/rad",
        2 * math.pi,
        0.01,
        3.0,
        0.2,
    ),
    "slider": JointLimits(
        "m",
        "N",
        "N s/m",
        0.5,
        0.0005,
        50.0,
        20.0,
    ),
}
MIN_MOVED_KG = 0.001
# An engine's step is 2 to 5 ms: a spring or a damper that acts faster than that shakes or explodes in some.
MAX_HZ = 20.0  # of what a spring moves, and what it hangs from gives way
MAX_DECAY = 100.0  # 1/s, at which a damper stops what it moves
# Of what springs move: faster, engines would need very many steps.
MAX_SPRUNG_M_S = 13.0
MAX_SPRINGS_J = 2.0  # of all bought springs of a tool
_PRINTED_M3 = 20e-6  # of material, from which the springs of a tool are made
MAX_PIN_M = 0.01  # from a hinge's axis to each of its two sides: an eye around a pin
MAX_INSIDE_M = 0.001  # what moves in what bears it, where the two are apart at rest
AWAY_M = 0.02  # so far from a hinge's axis, or as far as both are thick, its two sides may be in each other
ROUNDING_M = 1e-9
_POINTS_M = 0.01  # between points of what moves, at least
_MOST_POINTS = 16  # along each side
_LOOKS = 201  # over a range
_STEP_M = 0.005  # between places in which the two sides of a joint must touch
_FEWEST_STEPS = 9
_MOST_STEPS = 201


def spring_share(material: Material) -> float:
    """Compute which share of a bought spring's energy, torque and force springs of a material may have, 0 to 1.

    A bent spring of rectangular section holds a ninth of what its volume would at its strength, s^2 / 2 E each m^3.
    Where the material has no strength, springs are bought.
    """
    if material.strength_pa is None:
        return 1.0

    energy = _PRINTED_M3 * material.strength_pa**2 / (18 * material.young_pa)
    return min(1.0, energy / MAX_SPRINGS_J)


def check_joints(tool: Tool, robot: Robot, material: Material) -> None:
    """Check the joints of a tool.

    Args:
        tool: its joints, and what they move.
        robot: what it hangs from.
        material: what its springs are made of.

    Raises:
        DesignError: the first rule that is broken.
    """
    count = len(tool.bearers)
    if count == 0:
        return
    if count > MAX_JOINTS:
        raise DesignError.because(ToolReason.JOINT_COUNT, count=count, most=MAX_JOINTS)

    share = spring_share(material)
    measured = measure_lightness(tool).tolist()

    for bearer, lightness in zip(tool.bearers, measured, strict=True):
        try:
            _check_range(bearer.joint)
            _check_motion(tool, bearer, lightness)
            _check_strength(bearer.joint, share)
        except DesignError as error:
            where = f"the joint of component {bearer.name!r} "
            raise error.placed(where, component=bearer.name) from error

    _check_springs(tool, share * MAX_SPRINGS_J)

    mounts = mount_solids(tool, robot)
    solids = {name: mounts.get(name, []) for name in tool.borne_on}

    for part in tool.parts:
        solid = Solid(part.component, solid_geometry(part.shape), part.pose, part.shape)
        solids[part.bearer].append(solid)

    levers = measure_levers(tool).tolist()
    for bearer, lever in zip(tool.bearers, levers, strict=True):
        if bearer.joint.kind == "hinge":
            _check_pin(bearer, solids)
        _check_touch(bearer, solids, lever)
        _check_through(bearer, solids, lever)


def _check_springs(tool: Tool, most: float) -> None:
    """Refuse springs that hold too much together, or make something too fast; ``most``: the energy allowed, J."""
    joints = {bearer.name: bearer.joint for bearer in tool.bearers}
    energy = sum(joint.energy for joint in joints.values())

    if energy > most:
        strongest = max(joints, key=lambda name: joints[name].energy)
        raise DesignError.because(
            ToolReason.SPRINGS_ENERGY, energy_j=energy, most_j=most, component=strongest
        )

    for name, speed in zip(joints, bound_speeds(tool).tolist(), strict=True):
        if speed > MAX_SPRUNG_M_S:
            raise DesignError.because(
                ToolReason.SPRINGS_SPEED,
                component=name,
                speed_m_s=speed,
                most_m_s=MAX_SPRUNG_M_S,
            )


def _check_range(joint: ToolJoint) -> None:
    """Refuse a range that is too wide or next to nothing, and a spring that is relaxed too far off."""
    limits = LIMITS[joint.kind]
    span = {"lower": joint.lower, "upper": joint.upper, "unit": limits.unit}
    if max(-joint.lower, joint.upper) > limits.most:
        raise DesignError.because(ToolReason.JOINT_WIDE, most=limits.most, **span)

    if joint.upper - joint.lower < limits.least_range:
        raise DesignError.because(
            ToolReason.JOINT_NARROW, least=limits.least_range, **span
        )

    if not abs(joint.rest) <= limits.most:
        raise DesignError.because(
            ToolReason.SPRING_REST, rest=joint.rest, unit=limits.unit, most=limits.most
        )


def _check_motion(tool: Tool, bearer: Bearer, lightness: float) -> None:
    """Refuse what is too light, or moves too fast for an engine's steps.

    Args:
        tool: has the components that are moved.
        bearer: the joint that moves them.
        lightness: see `measure_lightness`.
    """
    joint = bearer.joint
    borne = tool.borne
    mass = sum(c.mass for c in tool.components if borne[c.name][0] == bearer.name)

    if mass < MIN_MOVED_KG:
        raise DesignError.because(
            ToolReason.JOINT_LIGHT, mass_kg=mass, least_kg=MIN_MOVED_KG
        )

    hertz = math.sqrt(joint.stiffness * lightness) / (2 * math.pi)
    if hertz > MAX_HZ:
        would_do = joint.stiffness * (MAX_HZ / hertz) ** 2
        raise DesignError.because(
            ToolReason.SPRING_STIFF, rate_hz=hertz, most_hz=MAX_HZ, would_do=would_do
        )

    most = MAX_DECAY / lightness
    if joint.damping > most:
        raise DesignError.because(
            ToolReason.DAMPING_FAST,
            damping=joint.damping,
            inertia=1 / lightness,
            most=most,
        )


def _check_strength(joint: ToolJoint, share: float) -> None:
    """Refuse springs, dampers and brakes that are too strong; ``share``: see `spring_share`."""
    limits = LIMITS[joint.kind]
    exerted = joint.stiffness * joint.strain
    most = share * limits.spring

    if exerted > most:
        raise DesignError.because(
            ToolReason.SPRING_STRONG,
            load=exerted,
            load_unit=limits.load,
            strain=joint.strain,
            unit=limits.unit,
            most=most,
        )

    _check_most("a damping", joint.damping, limits.damping, limits.resistance)
    _check_most("a dry friction", joint.friction, limits.spring, limits.load)


def _check_most(
    what: str,
    value: float,
    most: float,
    unit: str,
) -> None:
    if value > most:
        raise DesignError.because(
            ToolReason.JOINT_MOST, what=what, given=value, unit=unit, most=most
        )


def _check_pin(bearer: Bearer, solids: Mapping[str, Sequence[Solid]]) -> None:
    """Refuse a hinge whose axis passes one of its two sides too far off for a pin.

    The pin is as long as what turns on it.

    Args:
        bearer: the hinge.
        solids: by the names of what bears them, each in its frame.
    """
    axis = np.array(bearer.joint.axis)
    ends = []

    for solid in solids[bearer.name]:
        middle, half = solid.bounds()
        reach = half @ np.abs(axis)
        ends += [middle @ axis - reach, middle @ axis + reach]

    low = float(min(ends))
    high = float(max(ends))
    turn, _ = Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])
    pose = Pose.from_rotation((low + high) / 2 * axis, turn)
    pin = Solid("pin", solid_geometry(Cylinder(1e-4, high - low)), pose)

    on_parent = replace(pin, pose=bearer.pose @ pin.pose)
    for side, placed in ((bearer.name, pin), (bearer.parent, on_parent)):
        away = min(signed_distance(solid, placed) for solid in solids[side])
        if away > MAX_PIN_M:
            raise DesignError.because(
                ToolReason.HINGE_PIN,
                component=bearer.name,
                side=side,
                away_mm=1000 * away,
                most_mm=1000 * MAX_PIN_M,
            )


def _check_touch(
    bearer: Bearer, solids: Mapping[str, Sequence[Solid]], lever: float
) -> None:
    """Refuse a joint whose two sides come apart within its range: what joins them there must be a solid of one.

    Args:
        bearer: the joint.
        solids: by the names of what bears them, each in its frame.
        lever: how far from the axis what moves ends, metres; see `measure_levers`.
    """
    joint = bearer.joint
    pairs = list(itertools.product(solids[bearer.parent], solids[bearer.name]))

    count = (joint.upper - joint.lower) * lever / _STEP_M
    count = int(np.clip(count, _FEWEST_STEPS, _MOST_STEPS))

    near: tuple[Solid, Solid] | None = None  # what touched last: likely to go on
    for value in np.linspace(joint.lower, joint.upper, count).tolist():
        place = bearer.pose @ _move(joint, value)
        if near is not None and _touch(*near, place):
            continue

        near = next((pair for pair in pairs if _touch(*pair, place)), None)
        if near is None:
            raise DesignError.because(
                ToolReason.JOINT_LEAVES,
                component=bearer.name,
                parent=bearer.parent,
                place=value,
                unit=LIMITS[joint.kind].unit,
            )


def _check_through(
    bearer: Bearer, solids: Mapping[str, Sequence[Solid]], lever: float
) -> None:
    """Refuse a range in which what moves gets into what bears it: engines let the two pass through each other.

    Solids that touch at rest are the joint itself, and may near its axis. What bears the tool has no shape of
    ours, and is left to the other rules. The arguments are as those of `_check_touch`.
    """
    joint = bearer.joint
    bearing = [s for s in solids[bearer.parent] if s.shape is not None]
    begin = min(max(0.0, joint.lower), joint.upper)

    for still, moving in itertools.product(bearing, solids[bearer.name]):
        gap = _measure_gap(bearer, still, moving, begin)
        is_sleeve = joint.kind == "slider" and gap < -MAX_INSIDE_M
        for end in (joint.lower, joint.upper):
            value: float | None = None
            if gap > MAX_GAP_M:
                value = _find_inside(bearer, (still, moving), (begin, end), lever)
            elif not is_sleeve:
                values = np.linspace(begin, end, _LOOKS)
                value = _find_inside_away(bearer, still, moving, values)
            if value is not None:
                raise DesignError.because(
                    ToolReason.JOINT_THROUGH,
                    component=moving.name,
                    other=still.name,
                    bearer=bearer.name,
                    place=value,
                    unit=LIMITS[joint.kind].unit,
                )


def _find_inside(
    bearer: Bearer,
    pair: tuple[Solid, Solid],
    span: tuple[float, float],
    lever: float,
) -> float | None:
    """Find the first value of a joint at which two solids that were apart are in each other; None: there is none.

    Args:
        bearer: the joint.
        pair: what bears it, and what it moves.
        span: from which value to which.
        lever: how far what moves goes for each unit, metres, at most.
    """
    still, moving = pair
    value, end = span
    onward = math.copysign(1.0, end - value)
    gap = _measure_gap(bearer, still, moving, value)

    while (end - value) * onward > 0:
        value += onward * max(gap, MAX_INSIDE_M / 2) / lever
        value = min(value, end) if onward > 0 else max(value, end)
        gap = _measure_gap(bearer, still, moving, value)
        if gap < -MAX_INSIDE_M:
            return value

    return None


def _find_inside_away(
    bearer: Bearer, still: Solid, moving: Solid, values: Array
) -> float | None:
    """Find the first value of a joint at which two solids that touch at rest are in each other away from its axis.

    Points of what moves may get no deeper than they are at rest.

    Args:
        bearer: the joint.
        still: what bears it.
        moving: what it moves.
        values: of the joint, from that at rest on.

    Returns:
        The value; None: there is none.
    """
    assert still.shape is not None
    assert moving.shape is not None
    joint = bearer.joint
    points = _list_points(moving)
    if joint.kind == "hinge":
        axis = np.array(joint.axis)
        off_axis = points - np.outer(points @ axis, axis)
        thick = still.shape.thickness + moving.shape.thickness
        points = points[np.linalg.norm(off_axis, axis=1) > max(AWAY_M, thick)]
    if not len(points):
        return None

    most = min(MAX_INSIDE_M, still.shape.thickness / 4)
    allowed: Array | None = None
    for value in values.tolist():
        place = still.pose.inverse() @ bearer.pose @ _move(joint, value)
        depths = _measure_depths(still, place.apply(points))
        if allowed is None:
            allowed = np.maximum(depths, 0.0) + most
        if (depths > allowed).any():
            return float(value)

    return None


def _list_points(solid: Solid) -> Array:
    """List points (P, 3) in a solid, about `_POINTS_M` apart, in the frame of what bears it."""
    assert solid.shape is not None
    low, high = np.array(solid.shape.hull().bounds)
    counts = np.clip((high - low) / _POINTS_M, 2, _MOST_POINTS).astype(int)
    sides = [np.linspace(*ends) for ends in zip(low, high, counts, strict=True)]
    grid = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 3)
    inside = _measure_depths(solid, grid) > -ROUNDING_M
    return np.asarray(solid.pose.apply(grid[inside]))


def _measure_depths(solid: Solid, points: Array) -> Array:
    """Measure how deep points (P, 3) in a solid's frame are inside its hull, metres, (P,); below 0 they are outside."""
    assert solid.shape is not None
    hull = solid.shape.hull()
    offsets = (hull.face_normals * hull.triangles[:, 0]).sum(axis=1)
    depths = offsets[:, None] - hull.face_normals @ points.T
    return np.asarray(depths.min(axis=0))


def _measure_gap(bearer: Bearer, still: Solid, moving: Solid, value: float) -> float:
    """Measure the gap between two solids where a joint is at a value, metres; below 0 how deep they are."""
    place = bearer.pose @ _move(bearer.joint, value)
    return signed_distance(still, replace(moving, pose=place @ moving.pose))


def _move(joint: ToolJoint, value: float) -> Pose:
    """Place a joint's link at a value, in its frame at 0."""
    way = value * np.array(joint.axis)
    if joint.kind == "slider":
        return Pose(way)

    return Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(way))


def _touch(still: Solid, moving: Solid, place: Pose) -> bool:
    """Report whether two solids touch, the second being moved to a place."""
    placed = replace(moving, pose=place @ moving.pose)
    return signed_distance(still, placed) <= MAX_GAP_M
