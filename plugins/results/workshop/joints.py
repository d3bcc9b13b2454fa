"""Join two pieces of a solid where it was cut: by a tongue in a socket, with two screws.

In the frame of a joint z leads along the shaft, from the tongue to the socket; y across its thin side, to where the
screws' heads are; the cut is at 0. Lengths are millimetres, but those of placed shapes.

A shaft that is too thin for a screw is made thicker around the joint: on the side of the heads, so that the other side
stays flat.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import manifold3d
import numpy as np

from core.design import Component
from core.designs.stiffness import second_moment
from core.geometry import Array, Mesh, Pose
from core.values.materials import Material
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import Placed, rod, union

TONGUE_MM = 7.5
"""The thinnest tongue: an insert M3, and what closes its bore."""

WALL_MM = 2.0
"""The thinnest wall of a socket: the head of a countersunk screw M3."""

WALL = 0.1
"""How thick the wall is, by the shaft's thickness, so that tongue and socket are alike in strength."""

REACH_MM = (25.0, 40.0)
"""The shortest and the longest tongue; between them it is 1.5 times as long as its shaft is thick."""

KERF_MM = 0.1  # between two pieces; a joint's own tolerance
ROOT_MM = 6.0  # of the shaft, below the tongue, is thickened with it
FREE_MM = 1.0  # between a joint and all else
WELD_MM = 0.55  # by which a shaft may have been moved out, to close gaps
NOTHING_MM3 = 1.0
DEEPER_MM = 0.5  # than its tongue is a socket
KEY_MM = 60.0  # above a screw's head, for a driver of a radius of 3 mm
WIDE_MM = 40.0  # a shaft that has its screws side by side
INSERT_MM = 4.5  # of threads that a screw needs at least
SCREWS_MM = (8, 10, 12, 16, 20)
HEAD_MM = 3.3  # the radius of a countersink M3
BORE_MM = 1.7
SINK_MM = 1.6
SCREW_G = 1.0  # with its insert
SCREWS = 2
ASIDE_MM = 0.02  # of bores: with a corner on the edge of a round shaft a mesh would not be closed

SAME_AREA = 0.01  # of a section that is convex

Make = Callable[[Sequence[Placed]], Any]
"""Makes a solid of shapes: a Manifold (`union`), or that of another kernel with the same operators."""


class Room(NamedTuple):
    """What a joint needs: its shaft, with a root below it, nothing else around it, and free ways to its screws.

    Shaft and surroundings are Manifolds, millimetres.
    """

    shaft: Any
    around: Any
    keys: tuple[Placed, ...]

    def is_in(self, solid: Any) -> bool:
        """Report whether a solid, a Manifold in millimetres, has it.

        So a joint is never in a mount, in a bore, or where components meet; but its tongue may rise from what is wider.
        """
        lack = (self.shaft - solid).volume()
        excess = (solid ^ self.around).volume() + (solid ^ union(self.keys)).volume()
        return bool(lack + excess < NOTHING_MM3)


class Feature(NamedTuple):
    """What a joint adds to a piece, and then takes away from it."""

    adding: tuple[Placed, ...]
    taking: tuple[Placed, ...]

    def apply(self, solid: Any, make: Make) -> Any:
        """Make it of a piece."""
        if self.adding:
            solid = solid + make(self.adding)
        if self.taking:
            solid = solid - make(self.taking)

        return solid


@dataclass(frozen=True, eq=False)
class Joint:
    """Two pieces, joined: what the cut takes away, and what it makes of both.

    Attributes:
        component: that is cut.
        frame: (4, 4), leads to the frame of the mount.
        room: what it needs.
        slab: parts the solid.
        probe: lies right below the cut.
        tongue: of the piece below, and ``socket`` of the piece above.
        simulated: as what it is simulated: all of it where it stands out, else the tongue.
        moduli_mm3: of the weakest section about x and y: a moment over it is a stress.
        thicker_mm: by how much the shaft is thicker there.
        reach_mm: the length of the tongue.
        screw: one of the two.
        name: of the component that stands for it in simulation.
        pieces: the numbers of the piece with the tongue and of that with the socket.
        beside: the slabs of all cuts that open a loop together with this one; empty: it parts the solid alone.
    """

    component: str
    frame: Array
    room: Room
    slab: Placed
    probe: Placed
    tongue: Feature
    socket: Feature
    simulated: Placed
    moduli_mm3: tuple[float, float]
    thicker_mm: float
    reach_mm: float
    screw: str
    name: str = "joint"
    pieces: tuple[int, int] = (0, 0)
    beside: tuple[Placed, ...] = ()

    @property
    def place(self) -> Array:
        """The middle of the cut (3,), metres, in the frame of the mount."""
        return self.frame[:3, 3] / 1000

    @property
    def along(self) -> Array:
        """From tongue to socket, a unit vector (3,)."""
        return self.frame[:3, 2]

    @property
    def mass_g(self) -> float:
        """What its screws and inserts weigh."""
        return SCREWS * SCREW_G

    def as_component(self, bearer: str) -> Component:
        """Return what stands for it in simulation, with the mass of its screws.

        Args:
            bearer: of the link that it is in.
        """
        shape, pose = self.simulated
        return Component(self.name, bearer, pose, shape, self.mass_g / 1000)

    def split(self, solid: Any, make: Make = union) -> tuple[Any, Any] | None:
        """Cut a solid in two, without tongue and socket; None: it does not fall into two.

        Args:
            solid: millimetres.
            make: makes the slab, as the solid is made.

        Returns:
            The piece that gets the tongue, and that which gets the socket.
        """
        pieces = (solid - make([self.slab, *self.beside])).decompose()
        if len(pieces) != 2:
            return None

        below, _ = self.find_pieces(pieces, make)
        return pieces[below], pieces[1 - below]

    def find_pieces(self, solids: Sequence[Any], make: Make = union) -> tuple[int, int]:
        """Say which pieces it joins: the number of that with the tongue, and of that with the socket.

        Args:
            solids: the pieces; of one that is not cut yet both numbers are its.
            make: makes what is looked for in them, as they are made.
        """
        shape, pose = self.probe
        ahead = Pose((self.reach_mm + 2.5) / 1000 * self.along)
        numbers = []
        for probe in ((shape, pose), (shape, ahead @ pose)):
            looked_for = make([probe])
            shared = [(solid ^ looked_for).volume() for solid in solids]
            numbers.append(int(np.argmax(shared)))

        return numbers[0], numbers[1]

    def finish(self, below: Any, above: Any, make: Make = union) -> tuple[Any, Any]:
        """Add the tongue to the piece below, and the socket to that above."""
        return self.tongue.apply(below, make), self.socket.apply(above, make)


class Profile(NamedTuple):
    """A convex section across z, a CrossSection of manifold3d."""

    section: Any

    @property
    def low(self) -> Array:
        return np.array(self.section.bounds()[:2])

    @property
    def high(self) -> Array:
        return np.array(self.section.bounds()[2:])

    @property
    def size(self) -> Array:
        return self.high - self.low

    def grown(self, by: float) -> Profile:
        """Move its sides out."""
        return Profile(self.section.offset(by, manifold3d.JoinType.Miter))

    def raised(self, by: float) -> Profile:
        """Move it along y."""
        return Profile(self.section.translate((0.0, by)))

    def solid(self, frame: Array, low: float, high: float) -> Any:
        """Return it from one z to another as a Manifold, in the frame of the mount."""
        pushed = self.section.extrude(high - low).translate((0.0, 0.0, low))
        return pushed.transform(frame[:3])

    def pushed(self, frame: Array, low: float, high: float) -> Placed:
        """Return it from one z to another, in the frame of the mount."""
        corners = np.vstack(self.section.to_polygons())
        ends = [
            np.column_stack([corners, np.full(len(corners), z)]) for z in (low, high)
        ]
        return _hull(frame, np.vstack(ends))

    def modulus(
        self, axis: int, material: Material, hole: Profile | None = None
    ) -> float:
        """Compute the section modulus about an axis, of walls and infill, mm³.

        Args:
            axis: 0: about x.
            material: says how much of it is filled.
            hole: a section within it that is empty.
        """
        thick = float(self.size[1 - axis])
        wide = float(self.size[axis])
        filled = float(self.section.area()) / (thick * wide)
        if hole is None:
            of_metres = second_moment(wide / 1000, thick / 1000, material)
            second = 1e12 * float(of_metres)
        else:
            inner = float(hole.size[1 - axis])
            across = float(hole.size[axis])
            second = (wide * thick**3 - across * inner**3) / 12

        return filled**2 * second / (thick / 2)


def _hull(frame: Array, points: Array) -> Placed:
    """Return the convex hull of points (N, 3) in a joint's frame."""
    placed = points @ frame[:3, :3].T + frame[:3, 3]
    return Mesh.hull_of(placed / 1000), Pose()


def convex_section(solid: Any, frame: Array) -> Profile | None:
    """Return the section of a component where a joint's frame (4, 4) is; None: it is not convex.

    Args:
        solid: the component as a Manifold, millimetres.
        frame: of the section, whose z is square to it.
    """
    section = solid.transform(np.linalg.inv(frame)[:3]).slice(0.0)
    if section.is_empty() or len(section.to_polygons()) != 1:
        return None

    convex = section.hull()
    if section.area() < (1 - SAME_AREA) * convex.area():
        return None

    return Profile(convex)


def make_joint(
    component: str, frame: Array, profile: Profile, fit: Fit, material: Material
) -> Joint | None:
    """Make a joint for a shaft of a section; None: its section has no room for a tongue.

    Args:
        component: the name of what is cut.
        frame: (4, 4) of the joint.
        profile: the component's section.
        fit: the gap between tongue and socket, and the bore of an insert.
        material: of the tool.
    """
    thick = float(profile.size[1])
    gap = fit.joint_mm
    wall = max(WALL_MM, WALL * thick)
    inset = min(wall + gap, (thick - TONGUE_MM) / 2)
    outset = wall + gap - inset
    raised = outset if outset > 0 else 0.0

    tongue = profile.grown(-inset).raised(raised)
    if tongue.section.is_empty() or min(tongue.size) < TONGUE_MM - 0.1:
        return None

    pocket = tongue.grown(gap)
    outer = pocket.grown(wall) if outset > 0 else profile
    reach = float(np.clip(1.5 * thick, *REACH_MM))
    end = reach + DEEPER_MM
    root = ROOT_MM if outset > 0 else 1.0

    length = next(size for size in SCREWS_MM if size >= wall + gap + INSERT_MM)
    deep = min(length - wall - gap + 0.1, float(tongue.size[1]) - 1.0)
    bores, holes = _drill(frame, tongue, outer, reach, deep, fit.insert_mm / 2)

    adding = [tongue.pushed(frame, -root, reach)]
    around = list[Placed]()
    if outset > 0:
        adding.append(outer.pushed(frame, -root, 0.0))
        around.append(outer.pushed(frame, KERF_MM, end + wall))

    shown = tongue.pushed(frame, 0.0, reach)
    if outset > 0:
        shown = outer.pushed(frame, -root, end + wall)

    def weakest(axis: int) -> float:
        whole = tongue.modulus(axis, material)
        return min(whole, outer.modulus(axis, material, pocket))

    return Joint(
        component=component,
        frame=frame,
        room=_find_room(frame, profile, outer, reach, end + wall),
        slab=outer.grown(FREE_MM).pushed(frame, 0.0, KERF_MM),
        probe=profile.pushed(frame, -1.0, -KERF_MM),
        tongue=Feature(tuple(adding), bores),
        socket=Feature(tuple(around), (pocket.pushed(frame, 0.0, end), *holes)),
        simulated=shown,
        moduli_mm3=(weakest(0), weakest(1)),
        thicker_mm=max(0.0, 2 * outset),
        reach_mm=reach,
        screw=f"M3 x {length}",
    )


def _find_room(
    frame: Array, profile: Profile, outer: Profile, reach: float, length: float
) -> Room:
    """Say what a joint needs.

    Args:
        frame: (4, 4) of the joint.
        profile: the shaft's section.
        outer: the socket's.
        reach: the length of the tongue.
        length: of the socket.
    """
    keys = []
    high = float(outer.high[1]) + FREE_MM
    for x, z in screw_places(profile, reach):
        start = frame[:3, :3] @ (x, high, z) + frame[:3, 3]
        stop = start + KEY_MM * frame[:3, 1]
        keys.append(rod(start / 1000, stop / 1000, HEAD_MM / 1000))

    zone = outer.grown(FREE_MM).solid(frame, 0.0, length)
    grown = profile.grown(WELD_MM).solid(frame, -1.0, length + 1.0)
    return Room(
        shaft=profile.grown(-0.05).solid(frame, -ROOT_MM / 2, length),
        around=zone - grown,
        keys=tuple(keys),
    )


def _drill(
    frame: Array,
    tongue: Profile,
    outer: Profile,
    reach: float,
    deep: float,
    radius: float,
) -> tuple[tuple[Placed, ...], tuple[Placed, ...]]:
    """Make the bores of two inserts in a tongue, and of their screws in the socket.

    Args:
        frame: (4, 4) of the joint.
        tongue: its section.
        outer: the socket's.
        reach: the length of the tongue.
        deep: how deep the inserts' bores are.
        radius: of the inserts' bores.
    """
    low = float(tongue.high[1])
    high = float(outer.high[1])
    bores = list[Placed]()
    holes = list[Placed]()
    for x, z in screw_places(tongue, reach):

        def point(y: float, x: float = x, z: float = z) -> Array:
            return (frame[:3, :3] @ (x, y, z) + frame[:3, 3]) / 1000

        bores.append(rod(point(low - deep), point(low + DEEPER_MM), radius / 1000))
        holes.append(rod(point(low - DEEPER_MM), point(high + 1), BORE_MM / 1000))
        holes.append(_sink(frame, (x, z), high))

    return tuple(bores), tuple(holes)


def screw_places(tongue: Profile, reach: float) -> list[tuple[float, float]]:
    """Return x and z of both screws: side by side where the tongue is wide, else behind each other."""
    middle = float(tongue.low[0] + tongue.high[0]) / 2 + ASIDE_MM
    wide = float(tongue.size[0])
    if wide >= WIDE_MM:
        return [(middle - wide / 4, reach / 2), (middle + wide / 4, reach / 2)]

    return [(middle, 0.35 * reach), (middle, 0.75 * reach)]


def _sink(frame: Array, place: tuple[float, float], high: float) -> Placed:
    """Make the cone that takes a screw's head.

    Args:
        frame: (4, 4) of the joint.
        place: x and z of the screw.
        high: the y of the surface.
    """
    angles = np.arange(32) * math.tau / 32
    ring = np.column_stack([np.cos(angles), np.zeros(32), np.sin(angles)])
    x, z = place
    bottom = BORE_MM * ring + (x, high - SINK_MM, z)
    top = (HEAD_MM + 0.05) * ring + (x, high + 0.05, z)

    return _hull(frame, np.vstack([bottom, top]))
