"""Fit a tool to the arm, by a plate with bores for the flange or a sleeve for a finger.

Lengths of settings are millimetres, all else metres, in the frame of the mount.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import RIGID_MOUNT, Component
from core.errors import UserError
from core.geometry import Array, Cylinder, Mesh, Pose, resized
from core.robot.extents import fingers_of
from core.robot.kinematics import link_poses
from core.robot.solids import corners, robot_solids
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.printing import PLA_G_PER_CM3, Check
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import Placed, ToolLink, box, hull, rod, union

HEADS_MM = {
    "M3": 5.5,
    "M4": 7.0,
    "M5": 8.5,
    "M6": 10.0,
    "M8": 13.0,
    "M10": 16.0,
}  # ISO 4762
SCREWS_MM = (10, 12, 16, 20, 25, 30, 35, 40)
LEAST_THREADS = 0.8  # of its diameter: how deep a screw must go, in aluminium
LEFT = 0.6  # of a component's section that must be left where a screw's way is cut
BOSS_MM = 3.0  # ISO's recess is at least 3.5 mm deep
CENTRING_MM, PIN_MM = (
    0.2,
    0.1,
)  # by which the boss is narrower than the recess, and the pin's bore wider than the pin
DRIVER_MM = 50.0  # below a screw's head, for the screw and a bent key
WALL_MM, SLEEVE_MM = 2.4, 25.0  # a sleeve's wall, and its length from the finger's tip
MOST_LOST = 0.1  # of a component, where the arm is
LEAST_KG = 1e-4
CORE_MM = 2.5  # bore of a thread M3, which metal takes without an insert
CLAMP_MM = 6.0  # thickness of plastic around a clamping insert


@dataclass(frozen=True)
class Mount:
    """A solid that is fitted to the arm.

    Attributes:
        solid: a Manifold, with what was added to its components, and without what was taken away.
        adding, taking: these shapes.
        simulated: shapes like those that were added, as components, and ``name``, what they are.
        checks, hardware: what was checked, and what is bought.
    """

    solid: Any
    name: str = ""
    simulated: tuple[Placed, ...] = ()
    adding: tuple[Placed, ...] = ()
    taking: tuple[Placed, ...] = ()
    checks: tuple[Check, ...] = ()
    hardware: tuple[str, ...] = ()


def at_flange(robot: Robot, link: ToolLink, solid: Any, fit: Fit) -> Mount:
    """Make the plate of a rigid tool, whose link the solid is.

    The mount's origin is in the flange's face, and the tool extends toward -z, so that the plate is right below z = 0.
    What the tool has above it is cut away where the arm is. Descriptions agree: the last link's mesh ends at the frame
    of the flange, where grippers are mounted. `Flange.disc`, which is half above that plane and half below, only bears
    tools in simulation.

    Raises:
        UserError: the thread is none of `HEADS_MM`.
    """
    flange = robot.flange
    t = fit.plate_mm / 1000
    if flange.thread not in HEADS_MM:
        known = ", ".join(HEADS_MM)
        raise UserError(
            f"robot {robot.name}: no screw is known for thread {flange.thread!r}; {known} are"
        )
    plate = _upright((0, 0), -t, 0, flange.disc.radius)
    added = [plate]
    if flange.centring_m is not None:
        height = min(BOSS_MM / 1000, flange.centring_depth_m - 0.0005)
        added.append(
            _upright(
                (0, 0), -t / 2, height, (1000 * flange.centring_m - CENTRING_MM) / 2000
            )
        )
    arm = _arm(robot)
    clear = solid - union(arm)
    lost = max(
        (union([shape]) ^ union(arm)).volume() / union([shape]).volume()
        for shape in link.shapes
    )
    bores, screws, covered = _screws(robot, link, clear + union([plate]), fit)
    places = [bore[1].position for bore in bores[::2]]
    apart = max(
        (float(np.linalg.norm(one - other)) for one in places for other in places),
        default=0.0,
    )
    found = f"{len(screws)} of {flange.bolts} screws can be driven"
    found += f"; in the way of the others: {', '.join(covered)}" if covered else ""
    checks = (
        Check(
            "clear of the arm",
            lost < MOST_LOST,
            f"at most {lost:.0%} of a component is cut away where the arm is",
        ),
        Check("screws", len(screws) >= 3 or (len(screws) == 2 and apart > 0.04), found),
    )
    hardware = [f"{screws.count(kind)} x {kind}" for kind in dict.fromkeys(screws)]
    if flange.pin_angle is not None:
        bores.append(
            _upright(
                _on_circle(robot, flange.pin_angle),
                -t,
                0.001,
                (1000 * flange.pin_m + PIN_MM) / 2000,
            )
        )
        hardware.append(f"1 pin {1000 * flange.pin_m:g} m6 x 12")
    fitted = clear + union(added) - union(bores)
    taken = (*arm, *bores)
    return Mount(
        fitted, "mount_plate", (plate,), tuple(added), taken, checks, tuple(hardware)
    )


def _upright(
    at: Sequence[float] | Array, low: float, high: float, radius: float
) -> Placed:
    return Cylinder(radius, high - low), Pose(
        np.array([at[0], at[1], (low + high) / 2])
    )


def _on_circle(robot: Robot, angle: float) -> Array:
    return robot.flange.bolt_circle_m / 2 * np.array([math.cos(angle), math.sin(angle)])


def _arm(robot: Robot) -> tuple[Placed, ...]:
    """The arm's last links above the flange's face, and the flange itself."""
    poses = link_poses(robot, False, np.array(robot.home))
    mount = poses[RIGID_MOUNT].inverse()
    found = [_upright((0, 0), 0, 0.01, robot.flange.disc.radius + 0.0005)]
    for solid in robot_solids(robot, False):
        if solid.name in robot.near_mount:
            points = (mount @ poses[solid.name] @ solid.pose).apply(
                corners(solid.geometry)
            )
            found.append((hull(np.maximum(points, (-np.inf, -np.inf, 0.0))), Pose()))
    return tuple(found)


def _screws(
    robot: Robot, link: ToolLink, before: Any, fit: Fit
) -> tuple[list[Placed], list[str], dict[str, None]]:
    """Find bores and ways of keys for the screws that can be driven, their kinds, and the components in others' way.

    A head rests on the plate, or below a component that is thick enough around the bore: a long screw through a beam
    leaves more of it than a way for a short one.
    """
    flange = robot.flange
    head = HEADS_MM[robot.flange.thread]
    size = float(flange.thread[1:])
    t = fit.plate_mm
    cuts = list[Placed]()
    kinds = list[str]()
    covered = dict[str, None]()
    ring = [
        (0.0, 0.0),
        *((math.cos(a), math.sin(a)) for a in np.arange(12) * math.tau / 12),
    ]
    fitting = [
        length for length in SCREWS_MM if length >= t + LEAST_THREADS * size - 1e-6
    ]
    for number in range(flange.bolts):
        at = _on_circle(robot, flange.bolt_angle + number * math.tau / flange.bolts)
        deep = min(
            _depth(before, 1000 * at + head / 2 * np.array(way), t) for way in ring
        )
        seats = [
            (min(deep, n - LEAST_THREADS * size), n)
            for n in fitting
            if n - 1000 * flange.thread_depth_m <= deep
        ]
        if not seats or deep < t - 1e-6:
            raise UserError(
                f"no screw {flange.thread} fits a plate of {t:g} mm; set fit.plate_mm to 7, 10 or 15"
            )
        seat, long = max(seats)
        way = _upright(at, -(seat + DRIVER_MM) / 1000, -seat / 1000, (head + 1) / 2000)
        bore = _upright(
            at, -seat / 1000 - 1e-4, 0.001, (size + fit.clearance_mm) / 2000
        )
        blocking = _too_weak(link, (bore, way))
        if blocking is None:
            cuts += [bore, way]
            kinds.append(f"{flange.thread} x {long}")
        else:
            covered[blocking] = None
    return cuts, kinds, covered


def _depth(before: Any, at: Array, start: float) -> float:
    """Measure how far below the face a solid goes without a gap, in millimetres."""
    low = before.bounding_box()[2] - 1
    for hit in before.ray_cast((*at, -start / 2), (*at, low)):
        if hit.normal[2] < -1e-6:
            return -float(hit.position[2])
    return 0.0


def _too_weak(link: ToolLink, cut: Sequence[Placed]) -> str | None:
    """Name the component of which a screw's bore and way leave less than `LEFT` of a section along its own axes."""
    away = union(cut)
    for name, (shape, pose) in zip(link.names, link.shapes, strict=True):
        own = union([(shape, pose)])
        shared = own ^ away
        if shared.volume() < 1:
            continue
        box = np.array(shared.bounding_box())
        middle = (box[:3] + box[3:]) / 2
        for axis in np.eye(3):
            turn = Rotation.align_vectors(
                [[0.0, 0.0, 1.0]], [pose.rotation.apply(axis)]
            )[0].as_matrix()
            level = [
                solid.transform(np.column_stack([turn, -turn @ middle]))
                .slice(0.0)
                .area()
                for solid in (own, shared)
            ]
            if level[0] > 0 and 1 - level[1] / level[0] < LEFT:
                return name
    return None


def on_finger(robot: Robot, link: ToolLink, solid: Any, fit: Fit) -> Mount:
    """Make the sleeve that an attachment is slid onto a finger with, and its clamping screw.

    The finger's collision shapes, moved along it to its base, are cut out of the attachment: it goes on from the tip.
    """
    finger = next(finger for finger in fingers_of(robot) if finger.name == link.bearer)
    gap = fit.sleeve_mm / 1000
    wall = WALL_MM / 1000
    tip = finger.tip
    hulls = [
        s.pose.apply(corners(s.geometry))
        for s in robot_solids(robot, True)
        if s.name == link.bearer
    ]
    slid = [hull(np.vstack([points, points - 0.15 * tip])) for points in hulls]
    cavity = tuple(
        (resized(shape, shape.bounds[1] + 2 * gap), Pose()) for shape in slid
    )
    low, high = _clasped(slid, tip, finger.face(tip), SLEEVE_MM / 1000)
    low = low - gap
    high = high + gap
    side = np.cross(np.abs(finger.opens), np.abs(tip))
    around = np.ones(3) - np.abs(tip)
    widths = high - low
    walls = box(
        low - wall * (around + np.maximum(-tip, 0)),
        high + wall * (around + np.maximum(tip, 0)),
    )
    middle = (low + high) / 2
    out = np.abs(side) * (widths / 2 + CLAMP_MM / 1000)
    half = np.minimum(widths / 2, 0.005) * (1 - np.abs(side))
    clamp = box(middle - half, middle + half + out)
    bore = rod(middle, middle + out + 0.001 * np.abs(side), fit.insert_mm / 2000)
    ends = [
        (axis, end) for axis in range(3) for end in (-1, 1) if end * tip[axis] >= 0
    ]  # it is open at its base
    kept = [_sheet(low, high, wall, axis, end) for axis, end in ends]
    lost = (solid ^ union(cavity)).volume() / solid.volume()
    checks = (
        Check(
            "finger",
            lost < 0.5,
            f"{lost:.0%} of the attachment is cut away where the finger is",
        ),
        Check(
            "sleeve",
            True,
            f"its wall stands {1000 * (gap + wall):.1f} mm before the inner face",
        ),
    )
    held = "a thread M3 is cut into" if fit.insert_mm <= CORE_MM else "1 insert M3 for"
    hardware = "1 x M3 x 8 set screw", f"{held} a bore of {fit.insert_mm:g} mm"
    adding = (walls, clamp)
    taking = (*cavity, bore)
    fitted = solid + union(adding) - union(taking)
    return Mount(
        fitted,
        f"{link.bearer}_sleeve",
        (*kept, clamp),
        adding,
        taking,
        checks,
        hardware,
    )


def _clasped(
    slid: Sequence[Mesh], tip: Array, end: float, length: float
) -> tuple[Array, Array]:
    """Find the bounds of a finger, slid to its base, over the length of the sleeve: lowest and highest (3,)."""
    axis = int(np.abs(tip).argmax())
    start = end - length * tip[axis]
    window = [
        box(
            *np.sort(
                [
                    np.where(np.abs(tip) > 0, start, -1.0),
                    np.where(np.abs(tip) > 0, end, 1.0),
                ],
                axis=0,
            )
        )
    ]
    inside = (
        np.array(
            (union([(shape, Pose()) for shape in slid]) ^ union(window)).bounding_box()
        )
        / 1000
    )
    return inside[:3], inside[3:]


def _sheet(low: Array, high: Array, wall: float, axis: int, end: int) -> Placed:
    first = low.copy()
    last = high.copy()
    first[axis], last[axis] = (
        (high[axis], high[axis] + wall) if end > 0 else (low[axis] - wall, low[axis])
    )
    return box(first, last)


def weighed(
    mount: Mount, link: ToolLink, taken: Collection[str], material: Material
) -> list[Component]:
    """Return what a mount adds as components, whose names are not taken, with the mass of what is not in the link."""
    if not mount.simulated:
        return []
    added = union(mount.simulated)
    share = (added - union(link.grown(0))).volume() / added.volume()
    density = share * (material.density_kg_m3 or 1000 * PLA_G_PER_CM3)
    components = []
    for number, (shape, pose) in enumerate(mount.simulated):
        name = f"{mount.name}_{number}" if number else mount.name
        while name in taken:
            name += "_"
        mass = max(LEAST_KG, density * material.volume_of(shape))
        components.append(Component(name, link.bearer, pose, shape, mass))
    return components
