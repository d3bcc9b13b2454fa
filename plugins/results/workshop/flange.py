"""Bolt a tool to the arm's flange, by a plate with bores for screws.

Lengths of settings are millimetres, all else metres, in the frame of the mount.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh

from core.design import RIGID_MOUNT
from core.errors import UserError
from core.geometry import Array, Cylinder, Mesh, Pose
from core.robot.kinematics import link_poses
from core.robot.solids import corners, robot_solids
from core.support.templates import macros
from core.values.robots import ISO_9409_1_50, Robot
from plugins.results.workshop.mount import Mount
from plugins.results.workshop.printing import Check
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import Placed, ToolLink, union

HEADS_MM = {"M3": 5.5, "M4": 7.0, "M5": 8.5, "M6": 10.0, "M8": 13.0, "M10": 16.0}
"""Diameters of the heads of screws, ISO 4762."""

SCREWS_MM = (10, 12, 16, 20, 25, 30, 35, 40)
LEAST_THREADS = 0.8  # of its diameter: how deep a screw must go, in aluminium
LEFT = 0.6  # of a component's section that must be left where a screw's way is cut
BOSS_MM = 3.0  # ISO's recess is at least 3.5 mm deep
CENTRING_MM = 0.2  # by which the boss is narrower than the recess
PIN_MM = 0.1  # by which the pin's bore is wider than the pin
DRIVER_MM = 50.0  # below a screw's head, for the screw and a bent key
MOST_LOST = 0.1  # of a component, where the arm is
APART_M = 0.04  # between two screws that hold a tool by themselves


@dataclass
class Screws:
    """The screws of a flange that can be driven.

    Attributes:
        places: where they are, (2,) each.
        kinds: their threads and lengths.
        cuts: bores, and ways of keys.
        covered: the components in the way of the others.
    """

    places: list[Array] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)
    cuts: list[Placed] = field(default_factory=list)
    covered: list[str] = field(default_factory=list)

    def check(self, bolts: int) -> Check:
        """Check that three of a flange's screws hold the tool, or two that are far apart."""
        held = len(self.kinds) >= 3
        if len(self.kinds) == 2:
            held = float(np.linalg.norm(self.places[0] - self.places[1])) > APART_M

        found = macros("plugins.results.workshop", "words").screws(self, bolts)
        return Check("screws", held, found, "narrow or move what is below them")


def at_flange(robot: Robot, link: ToolLink, solid: Any, fit: Fit) -> Mount:
    """Make the plate of a rigid tool.

    The mount's origin is in the flange's face, and the tool extends toward -z, so that the plate is right below z = 0.
    What the tool has above it is cut away where the arm is. Descriptions agree: the last link's mesh ends at the frame
    of the flange, where grippers are mounted. `Flange.disc`, which is half above that plane and half below, only bears
    tools in simulation.

    Args:
        robot: the arm, with its flange.
        link: the link of the tool that the flange bears.
        solid: the link as a Manifold, millimetres.
        fit: the plate's thickness, and by how much bores are wider than threads.

    Returns:
        The solid with its plate and bores, the screws to buy, and what was checked.

    Raises:
        UserError: the thread is none of `HEADS_MM`, or no screw fits the plate.
    """
    flange = robot.flange
    thickness = fit.plate_mm / 1000

    if flange.thread not in HEADS_MM:
        known = ", ".join(HEADS_MM)
        raise UserError(
            f"robot {robot.name}: no screw is known for thread {flange.thread!r}; {known} are"
        )

    plate = _upright((0, 0), -thickness, 0, flange.disc.radius)
    adding = [plate]
    if flange.centring_m is not None:
        height = min(BOSS_MM / 1000, flange.centring_depth_m - 0.0005)
        radius = (1000 * flange.centring_m - CENTRING_MM) / 2000
        adding.append(_upright((0, 0), -thickness / 2, height, radius))

    arm = _arm(robot)
    clear = solid - union(arm)
    screws = _find_screws(robot, link, clear + union([plate]), fit)
    checks = [_check_clear(link, arm), screws.check(flange.bolts)]
    if flange == ISO_9409_1_50:
        assumed = "ISO 9409-1-50-4-M6 with bolts at 45° is assumed: compare it with the arm's drawing (robot.bolts)"
        checks.append(Check("flange", None, assumed))

    hardware = [
        f"{screws.kinds.count(kind)} x {kind}" for kind in dict.fromkeys(screws.kinds)
    ]

    bores = screws.cuts

    if flange.pin_angle is not None:
        place = _on_circle(robot, flange.pin_angle)
        radius = (1000 * flange.pin_m + PIN_MM) / 2000
        bores = [*bores, _upright(place, -thickness, 0.001, radius)]
        hardware.append(f"1 pin {1000 * flange.pin_m:g} m6 x 12")

    return Mount(
        solid=clear + union(adding) - union(bores),
        name="mount_plate",
        simulated=(plate,),
        clearing=arm,
        adding=tuple(adding),
        taking=tuple(bores),
        checks=tuple(checks),
        hardware=tuple(hardware),
    )


def _upright(
    place: Sequence[float] | Array, low: float, high: float, radius: float
) -> Placed:
    """Return a cylinder along z.

    Args:
        place: x and y of its axis, metres.
        low: z of its lower end, metres.
        high: z of its upper end, metres.
        radius: metres.
    """
    middle = np.array([place[0], place[1], (low + high) / 2])
    return Cylinder(radius, high - low), Pose(middle)


def _on_circle(robot: Robot, angle: float) -> Array:
    """Return the place (x, y) on the circle of bolts at an angle from the mount's x, metres."""
    return robot.flange.bolt_circle_m / 2 * np.array([math.cos(angle), math.sin(angle)])


def _arm(robot: Robot) -> tuple[Placed, ...]:
    """Return the arm's last links above the flange's face, and the flange itself."""
    poses = link_poses(robot, False, np.array(robot.home))
    mount = poses[RIGID_MOUNT].inverse()
    found = [_upright((0, 0), 0, 0.01, robot.flange.disc.radius + 0.0005)]
    for solid in robot_solids(robot, False):
        if solid.name in robot.near_mount:
            place = mount @ poses[solid.name] @ solid.pose
            points = place.apply(corners(solid.geometry))
            found.append(
                (Mesh.hull_of(np.maximum(points, (-np.inf, -np.inf, 0.0))), Pose())
            )

    return tuple(found)


def _check_clear(link: ToolLink, arm: Sequence[Placed]) -> Check:
    """Check that no component loses much where the arm is."""
    lost = 0.0
    for shape in link.shapes:
        component = union([shape])
        lost = max(lost, (component ^ union(arm)).volume() / component.volume())

    found = f"at most {lost:.0%} of a component is cut away where the arm is"
    mend = "lower what rises above the mount"
    return Check("clear of the arm", lost < MOST_LOST, found, mend)


def _find_screws(robot: Robot, link: ToolLink, solid: Any, fit: Fit) -> Screws:
    """Find the screws that can be driven into a flange.

    A head rests on the plate, or below a component that is thick enough around the bore: a long screw through a beam
    leaves more of it than a way for a short one.

    Args:
        robot: the arm, with its flange.
        link: the tool's link, of which bores and ways of keys must leave enough.
        solid: the link with its plate, clear of the arm, as a Manifold, millimetres.
        fit: the plate's thickness, and by how much bores are wider than threads.

    Raises:
        UserError: no screw fits the plate.
    """
    flange = robot.flange
    head = HEADS_MM[flange.thread]
    size = float(flange.thread[1:])
    screws = Screws()
    for number in range(flange.bolts):
        angle = flange.bolt_angle + number * math.tau / flange.bolts
        place = _on_circle(robot, angle)
        seat, length = _find_seat(robot, solid, place, fit.plate_mm)
        top = -seat / 1000
        bottom = -(seat + DRIVER_MM) / 1000
        way = _upright(place, bottom, top, (head + 1) / 2000)
        bore = _upright(place, top - 1e-4, 0.001, (size + fit.clearance_mm) / 2000)

        weak = _find_weak(link, (bore, way))
        if weak is None:
            screws.places.append(place)
            screws.kinds.append(f"{flange.thread} x {length}")
            screws.cuts += [bore, way]
        elif weak not in screws.covered:
            screws.covered.append(weak)

    return screws


def _find_seat(
    robot: Robot, solid: Any, place: Array, plate_mm: float
) -> tuple[float, int]:
    """Find where the head of a screw rests: as deep as the solid around the bore is thick.

    Args:
        robot: the arm, with its flange.
        solid: the tool with its plate, as a Manifold, millimetres.
        place: x and y of the screw (2,), metres.
        plate_mm: the plate's thickness.

    Returns:
        How deep the head rests below the flange's face, and the length of the screw, millimetres.

    Raises:
        UserError: no screw fits the plate.
    """
    flange = robot.flange
    least = LEAST_THREADS * float(flange.thread[1:])
    deep = _measure_depth(solid, place, HEADS_MM[flange.thread] / 2000, plate_mm)
    seats = []
    for length in SCREWS_MM:
        reaches = length >= plate_mm + least - 1e-6
        if reaches and length - 1000 * flange.thread_depth_m <= deep:
            seats.append((min(deep, length - least), length))

    if not seats or deep < plate_mm - 1e-6:
        raise UserError(
            f"no screw {flange.thread} fits a plate of {plate_mm:g} mm; set fit.plate_mm to 7, 10 or 15"
        )

    return max(seats)


def _measure_depth(solid: Any, place: Array, radius: float, plate_mm: float) -> float:
    """Measure how far below the face a solid goes without a gap below a screw's head, millimetres.

    Args:
        solid: a Manifold, millimetres.
        place: x and y of the screw (2,), metres.
        radius: of its head, metres.
        plate_mm: the plate's thickness, from the middle of which on it is measured.
    """
    low = solid.bounding_box()[2] / 1000 - 0.001
    column = union([_upright(place, low, -plate_mm / 2000, radius)])
    gaps = column - solid
    return -float(gaps.bounding_box()[5])


def _find_weak(link: ToolLink, cut: Sequence[Placed]) -> str | None:
    """Name the component of which a screw leaves too little.

    A section along one of the component's own axes, through the middle of what is cut away, must keep the share
    `LEFT` of its area.

    Args:
        link: the tool's link.
        cut: the screw's bore, and the way of its key.

    Returns:
        The name of the first such component; None: all keep enough.
    """
    away = union(cut)
    for name, (shape, pose) in zip(link.names, link.shapes, strict=True):
        component = union([(shape, pose)])
        lost = component ^ away
        if lost.volume() < 1:
            continue

        bounds = np.array(lost.bounding_box())
        middle = (bounds[:3] + bounds[3:]) / 2

        for axis in pose.rotation_matrix.T:
            area = _section(component, middle, axis)
            if area > 0 and 1 - _section(lost, middle, axis) / area < LEFT:
                return name

    return None


def _section(solid: Any, middle: Array, axis: Array) -> float:
    """Measure the section of a solid through a point (3,), square to an axis (3,), mm²."""
    to_section = trimesh.geometry.plane_transform(middle, axis)
    return float(solid.transform(to_section[:3]).slice(0.0).area())
