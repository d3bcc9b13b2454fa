"""Cut a solid that is too large for a printer's plate into parts, and join them by dovetails.

A part is parted by a plane square to its longest side. Tails of one half slide into sockets of the other, all along one
direction of the plane, and come to rest on a floor; a drop of glue holds them. Lengths are millimetres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import manifold3d
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose
from plugins.results.workshop.printing import lay
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.solid import hull, to_mesh, union

MAX_PARTS = 24
PLACES = np.linspace(0.25, 0.75, 11)  # of the length, where a cut may be
DEEPEST, NARROWEST, FLAT = 15.0, 6.0, 0.85
SHARES = (1.0, 0.7, 0.5)  # of a column's width, for a tail
_FAR = 2000.0
_LEAST = 1.0  # thickness of a section that can be joined


@dataclass(frozen=True)
class Dovetails:
    """What joins two parts: the number of tails, the area of their necks, and that of the whole section, mm^2."""

    tails: int
    neck_mm2: float
    section_mm2: float

    def __str__(self) -> str:
        tails = f"{self.tails} dovetail{'s' * (self.tails > 1)}, necks of {self.neck_mm2:.0f} in"
        return f"{tails if self.tails else 'glue alone, on'} {self.section_mm2:.0f} mm²"


@dataclass(frozen=True)
class _Tail:
    """A tail in the frame of a cut: across (its middle and width), along (from, to), and the angle of that frame.

    ``floor`` is the thickness that closes its socket at one end; thin sections are cut through.
    """

    middle: float
    width: float
    low: float
    high: float
    angle: float
    floor: float

    @property
    def neck_mm2(self) -> float:
        return self.width / 3 * (self.high - self.low - self.floor)

    def solid(self, gap: float, beyond: float, floor: float) -> Array:
        """Return its corners (8, 3), ``gap`` wider on each side, rooted in the plane z = 0."""
        depth = min(self.width / 2, DEEPEST)
        neck = self.width / 6 + gap
        end = neck + depth / 6
        rows = [(-neck, -1.0), (neck, -1.0), (-end, depth + gap), (end, depth + gap)]
        ends = self.low + (floor - gap if floor else -beyond), self.high + beyond
        points = np.array([(self.middle + x, y, z) for x, z in rows for y in ends])
        turn = np.array([[math.cos(self.angle), math.sin(self.angle)], [-math.sin(self.angle), math.cos(self.angle)]])
        points[:, :2] = points[:, :2] @ turn  # back to the plane's own axes
        return points


def cut(solid: Any, printer: Printer, fit: Fit, axes: Array, whole: Array) -> tuple[list[Any], list[Dovetails]]:
    """Cut until each part fits the plate.

    Args:
        solid: a Manifold in the mount's frame.
        printer: its plate decides.
        fit: the gap in a joint.
        axes: (K, 3) directions of the components, of which a cut takes the one nearest to the longest side.
        whole: (N, 3) points between which no cut may lie: the mount's.

    Returns:
        The parts, and a joint for each cut.
    """
    done, todo, joints = list[Any](), [solid], list[Dovetails]()
    while todo:
        piece = todo.pop(0)
        if len(done) + len(todo) + 1 >= MAX_PARTS or lay(to_mesh(piece), printer.plate_mm)[1]:
            done.append(piece)
            continue
        near, far, joint = _divide(piece, printer, fit, axes, whole)
        joints.append(joint)
        todo[:0] = [*near.decompose(), *far.decompose()]
    return done, joints


def _divide(piece: Any, printer: Printer, fit: Fit, axes: Array, whole: Array) -> tuple[Any, Any, Dovetails]:
    """Cut where most regions of the section can be joined, away from the mount."""
    box = to_mesh(piece).bounding_box_oriented
    longest = np.asarray(box.primitive.transform)[:3, int(np.argmax(box.primitive.extents))]
    way = axes[np.abs(axes @ longest).argmax()]
    other = axes[np.abs(axes @ way).argmin()]
    other = other - (other @ way) * way
    frame = np.stack([other / np.linalg.norm(other), np.cross(way, other / np.linalg.norm(other)), way])
    turned = piece.transform(np.column_stack([frame, np.zeros(3)]))
    low, high = turned.bounding_box()[2], turned.bounding_box()[5]
    held, choices = whole @ way, []
    for place in (low + PLACES * (high - low)).tolist():
        section = turned.slice(place)
        regions = section.decompose()
        inside = bool(held.size and held.min() - DEEPEST < place < held.max() + DEEPEST)
        sound = [tail for tail in _tails(regions, printer) if tail is not None and _sound(turned, tail, place, fit)]
        choices.append(((not sound, inside, len(regions) - len(sound), len(regions), section.area()), place, sound))
    (*_, area), place, sound = min(choices, key=lambda choice: choice[0])
    back = Pose.from_rotation(place * way / 1000, Rotation.from_matrix(frame.T))
    below = np.array([(x, y, z) for x in (-_FAR, _FAR) for y in (-_FAR, _FAR) for z in (-_FAR, 0.0)])
    near, far = (
        union([(hull(p / 1000), back) for p in [below, *(tail.solid(gap, 1.0, tail.floor) for tail in sound)]])
        for gap in (0.0, fit.joint_mm)
    )
    return piece ^ near, piece - far, Dovetails(len(sound), sum(tail.neck_mm2 for tail in sound), area)


def _tails(regions: Sequence[Any], printer: Printer) -> list[_Tail | None]:
    """Find a tail for each region of a section, all slid along one side of the largest one's rectangle."""
    outline = np.vstack(max(regions, key=lambda region: region.area()).to_polygons())
    to_rectangle, _ = trimesh.bounds.oriented_bounds_2D(outline)
    angle = -math.atan2(to_rectangle[1, 0], to_rectangle[0, 0])
    ways = []
    for quarter in range(4):
        ways.append([_in_region(region, angle + quarter * math.pi / 2, printer) for region in regions])
    return max(ways, key=lambda tails: sum(tail.neck_mm2 for tail in tails if tail is not None))


def _in_region(region: Any, angle: float, printer: Printer) -> _Tail | None:
    """Put a tail into the middle of a region, as wide as the region is nearly a rectangle there."""
    turned = region.rotate(-math.degrees(angle))
    left, low, right, high = turned.bounds()
    for share in SHARES:  # what is round has a rectangle in its middle
        width = share * (right - left)
        column = manifold3d.CrossSection.square((width, high - low + 2), True)
        pieces = (turned ^ column.translate(((left + right) / 2, (low + high) / 2))).decompose()
        if width < NARROWEST or not pieces:
            break
        largest = max(pieces, key=lambda piece: piece.area())
        x0, y0, x1, y1 = largest.bounds()
        wide = x1 - x0
        thick = y1 - y0
        if wide >= max(NARROWEST, 0.9 * width) and thick >= _LEAST and largest.area() >= FLAT * wide * thick:
            floor = max(printer.min_wall_mm, 0.2 * thick) if thick >= 4 * printer.min_wall_mm else 0.0
            return _Tail((x0 + x1) / 2, wide, y0, y1, angle, floor)
    return None


def _sound(turned: Any, tail: _Tail, place: float, fit: Fit) -> bool:
    """Report whether a tail lies within the solid, and nothing is in its way as it slides in."""
    up = np.array([0.0, 0.0, place])
    inner = manifold3d.Manifold.hull_points(tail.solid(0.0, 0.0, max(tail.floor, 0.01)) + up)
    swept = manifold3d.Manifold.hull_points(tail.solid(fit.joint_mm, 500.0, tail.floor) + up)
    hidden = turned.trim_by_plane((0, 0, 1), place)
    hidden = hidden.trim_by_plane((-math.sin(tail.angle), math.cos(tail.angle), 0), tail.high + 0.1)  # past its end
    return bool((inner ^ turned).volume() > 0.95 * inner.volume() and (swept ^ hidden).volume() < 1.0)
