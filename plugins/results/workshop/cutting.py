"""Cut a solid that does not fit a printer's plate into pieces that do, and join them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from core.geometry import Array
from core.support.templates import macros
from core.values.materials import Material
from core.values.printers import Printer
from plugins.results.workshop.joints import (
    FREE_MM,
    KERF_MM,
    REACH_MM,
    Joint,
    Profile,
    convex_section,
    make_joint,
)
from plugins.results.workshop.lying import SUPPORT, Lying, lay, stand_on, turn_to_fit
from plugins.results.workshop.printing import thinnest
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.solid import ToolLink, to_mesh, union

MOST_PIECES = 12
LEAST_MM = 2 * REACH_MM[0]  # of a component along which it is cut
STEP_MM = 20.0  # between cuts that are tried
TRIED = 6  # cuts that have room, of which the best is taken
PARALLEL = 0.999  # cosine from which two components lie along one direction
UNFIRM_MM = 30.0  # of excess: what a piece that stands on little counts as
SPARE = 1.1  # times the thinnest wall that is asked for, a cut leaves at least,
KEPT = 0.95  # or so much of the thinnest one that was there
WASTE = 0.3  # of a piece: where supports take more, it is cut into two that lie flat, if a cut does it


class Cut(NamedTuple):
    """Where a component may be cut.

    Attributes:
        component: its number in its link.
        axis: of the component's own, along which the shaft is.
        at_mm: from the component's middle.
        flipped: whether its axis is against that of the cut before it, which opens a loop together with it.
    """

    component: int
    axis: int
    at_mm: float
    flipped: bool = False


class Halves(NamedTuple):
    """Two pieces, joined.

    Attributes:
        rank: by how they lie; the less, the better.
        joints: between them.
        below: the piece with the tongues, a Manifold.
        above: the piece with the sockets.
    """

    rank: tuple[float, float, float]
    joints: tuple[Joint, ...]
    below: Any
    above: Any


@dataclass(frozen=True, eq=False)
class Pieces:
    """A solid in pieces.

    Attributes:
        solids: Manifolds, with their tongues and sockets.
        joints: in the order in which they were cut.
        advice: what to change, where no cuts make it fit, so that it stays whole; empty: all fit.
    """

    solids: tuple[Any, ...]
    joints: tuple[Joint, ...] = ()
    advice: str = ""


def lies_well(lying: Lying) -> bool:
    """Report whether a piece fits the plate, stands firmly, and takes little support."""
    wasted = SUPPORT * lying.support_mm3
    flat = wasted <= WASTE * abs(float(lying.mesh.volume))
    return lying.fits and lying.firm and flat


def cut_to_fit(
    solid: Any,
    link: ToolLink,
    printer: Printer,
    fit: Fit,
    material: Material,
) -> Pieces:
    """Cut a solid into the fewest pieces that fit the plate, as far as cuts one by one lead there.

    Args:
        solid: a link of a tool with its mount, a Manifold in millimetres.
        link: whose components are cut.
        printer: whose plate counts.
        fit: the gaps of a joint.
        material: of the tool.
    """
    whole = lay(to_mesh(solid), printer.plate_mm)
    if whole.fits and whole.firm:
        return Pieces((solid,))

    cutter = _Cutter(link, printer, fit, material)
    done: list[Any] = []
    waiting = [solid]
    joints: list[Joint] = []

    while waiting:
        piece = waiting.pop(0)
        lying = lay(to_mesh(piece), printer.plate_mm)
        full = len(waiting) + len(done) + 1 >= MOST_PIECES
        halves = None if lies_well(lying) or full else cutter.cut(piece, lying)
        if halves is None and not lying.fits:
            return Pieces((solid,), (), cutter.advise(piece, lying))
        if halves is None:
            done.append(piece)
            continue

        joints += halves.joints
        waiting += [halves.below, halves.above]

    return Pieces(tuple(done), tuple(joints))


class _Cutter:
    """Cuts pieces of a link in two; see `cut_to_fit` for its arguments."""

    def __init__(
        self,
        link: ToolLink,
        printer: Printer,
        fit: Fit,
        material: Material,
    ) -> None:
        self._link = link
        self._printer = printer
        self._fit = fit
        self._material = material
        poses = [pose for _, pose in link.shapes]
        self._axes = _distinct(np.vstack([pose.rotation_matrix.T for pose in poses]))
        self._solids = [union([placed]) for placed in link.shapes]

    def cut(self, solid: Any, lying: Lying) -> Halves | None:
        """Cut a piece where that is best; None: no cut has room, none makes it better, or each leaves a sliver.

        Where no single cut parts it, two cuts open a loop.

        Args:
            solid: the piece, a Manifold in millimetres.
            lying: it as it lies.
        """
        singles = ((cut,) for cut in self._list_places())
        for listed in (singles, self._list_openings()):
            found = self._find_halves(solid, listed)
            if found:
                return self._choose(found, lying)

        return None

    def _find_halves(
        self, solid: Any, listed: Iterable[tuple[Cut, ...]]
    ) -> list[Halves]:
        """Join a piece at the cuts that seem best, of those that part it and have room.

        The best leave the fewest pieces that do not fit, by the least, and those that take the least room.
        """
        ranked = []
        for cuts in listed:
            parted = self._part(solid, cuts)
            if parted is not None:
                ranked.append((self._rank(parted), cuts))

        found = []
        for _, cuts in sorted(ranked, key=itemgetter(0)):
            halves = self._join(solid, cuts)
            if halves is not None:
                found.append(halves)
            if len(found) == TRIED:
                break

        return found

    def _choose(self, found: Sequence[Halves], lying: Lying) -> Halves | None:
        """Choose the best of some; None: none makes the piece better, or each leaves a sliver."""
        thin = min(SPARE * self._printer.min_wall_mm, KEPT * thinnest(lying.mesh))
        for halves in sorted(found, key=lambda halves: halves.rank):
            if lying.fits and halves.rank[0] > 0:
                break
            walls = [thinnest(to_mesh(half)) for half in (halves.below, halves.above)]
            if min(walls) >= thin:
                return halves

        return None

    def _list_openings(self) -> Iterator[tuple[Cut, Cut]]:
        """Yield pairs of cuts that may open a loop, across two components beside each other."""
        for cut in self._list_places():
            place = self._frame(cut.component, cut.axis, cut.at_mm)[:3]
            for other, (shape, pose) in enumerate(self._link.shapes):
                if other <= cut.component:
                    continue

                along = pose.rotation_matrix.T @ place[:, 2]
                axis = int(np.abs(along).argmax())
                middle, size = shape.bounds
                at_mm = float(
                    (place[:, 3] - 1000 * pose.apply(middle))
                    @ pose.rotation_matrix[:, axis]
                )
                if abs(along[axis]) < PARALLEL or abs(at_mm) > 500 * size[axis]:
                    continue

                yield cut, Cut(other, axis, at_mm, bool(along[axis] < 0))

    def _list_places(self) -> Iterator[Cut]:
        """Yield where components may be cut that are long enough."""
        for number, (shape, _) in enumerate(self._link.shapes):
            size = shape.bounds[1]
            for axis in range(3):
                length = 1000 * float(size[axis])
                if length < LEAST_MM:
                    continue

                count = max(3, int(length / STEP_MM) + 1)
                for at_mm in np.linspace(-length / 2, length / 2, count):
                    yield Cut(number, axis, float(at_mm))

    def _frame(self, number: int, axis: int, at_mm: float, turned: int = 0) -> Array:
        """Return the frame of a cut across a component.

        Args:
            number: of the component.
            axis: of its own, along which the shaft is.
            at_mm: where, from its middle.
            turned: 0 to 3: bit 0 swaps the pieces, bit 1 the sides of the screws.
        """
        shape, pose = self._link.shapes[number]
        middle, size = shape.bounds
        first, second = (other for other in range(3) if other != axis)
        thin = first if size[first] < size[second] else second

        frame = np.eye(4)
        along = pose.rotation_matrix[:, axis]
        frame[:3, 2] = -along if turned & 1 else along
        across = pose.rotation_matrix[:, thin]
        frame[:3, 1] = -across if turned & 2 else across
        frame[:3, 0] = np.cross(frame[:3, 1], frame[:3, 2])
        frame[:3, 3] = 1000 * pose.apply(middle) + at_mm * along

        return frame

    def _profile(
        self, number: int, axis: int, at_mm: float, turned: int = 0
    ) -> tuple[Array, Profile] | None:
        """Return the frame of a cut, and the section of the component above it; None: it is not convex there."""
        half = 500 * float(self._link.shapes[number][0].bounds[1][axis]) - 1.0
        ahead = -REACH_MM[0] / 2 if turned & 1 else REACH_MM[0] / 2
        within = float(np.clip(at_mm + ahead, -half, half))
        place = self._frame(number, axis, within, turned)
        profile = convex_section(self._solids[number], place)
        if profile is None:
            return None

        return self._frame(number, axis, at_mm, turned), profile

    def _part(self, solid: Any, cuts: Sequence[Cut]) -> tuple[Any, Any] | None:
        """Part a piece at components, on either side of each place; None: it does not fall into two."""
        for cut in cuts:
            place = (cut.component, cut.axis, cut.at_mm)
            found = self._profile(*place) or self._profile(*place, 1)
            if found is None:
                return None
            frame, profile = found
            solid = solid - profile.grown(FREE_MM).solid(frame, 0.0, KERF_MM)

        pieces = solid.decompose()
        if len(pieces) != 2:
            return None

        return pieces[0], pieces[1]

    def _rank(self, halves: Sequence[Any]) -> tuple[float, float, float]:
        """Rank two pieces by how they would lie on one of the sides of components."""
        excesses = []
        room = 0.0
        for half in halves:
            corners = half.hull().to_mesh().vert_properties[:, :3]
            ways = []
            for down in self._axes:
                turned = stand_on(down)
                _, excess = turn_to_fit(corners @ turned.T, self._printer.plate_mm)
                ways.append(max(0.0, excess))

            excesses.append(min(ways))
            room += float(np.prod(np.ptp(corners @ self._axes[:3].T, axis=0)))

        large = sum(excess > 0 for excess in excesses)
        return float(large), round(sum(excesses), 1), room

    def _join(self, solid: Any, cuts: Sequence[Cut]) -> Halves | None:
        """Cut a piece and make the joints, as they are turned best; None: one has no room."""
        found = []
        for turned in range(4):
            made = [self._make_joint(solid, cut, turned) for cut in cuts]
            joints = [joint for joint in made if joint is not None]
            if len(joints) < len(cuts):
                continue

            if len(joints) > 1:
                slabs = tuple(joint.slab for joint in joints)
                joints = [replace(joint, beside=slabs) for joint in joints]
            halves = joints[0].split(solid)
            if halves is None:
                continue
            below, above = halves
            if not all(_slides(joint, below, above) for joint in joints):
                continue
            if any(joint.find_pieces(halves) != (0, 1) for joint in joints[1:]):
                continue

            for joint in joints:
                below, above = joint.finish(below, above)
            rank = self._judge((below, above))
            found.append(Halves(rank, tuple(joints), below, above))
            if all(joint.thicker_mm == 0 for joint in joints):
                break  # another turn would lie as well

        return min(found, key=lambda halves: halves.rank, default=None)

    def _make_joint(self, solid: Any, cut: Cut, turned: int) -> Joint | None:
        """Make the joint of a cut, with its frame turned (`_frame`); None: it has no room in a piece."""
        turned ^= int(cut.flipped)
        shaft = self._profile(cut.component, cut.axis, cut.at_mm, turned)
        if shaft is None:
            return None

        frame, profile = shaft
        name = self._link.names[cut.component]
        joint = make_joint(name, frame, profile, self._fit, self._material)
        return joint if joint is not None and joint.room.is_in(solid) else None

    def _judge(self, pieces: Sequence[Any]) -> tuple[float, float, float]:
        """Rank pieces by how they lie: those that do not, by how much, and what printing takes."""
        plate = self._printer.plate_mm
        ways = [lay(to_mesh(piece), plate) for piece in pieces]
        badly = sum(not lies_well(way) for way in ways)
        excess = sum(way.excess_mm + (0.0 if way.firm else UNFIRM_MM) for way in ways)
        return float(badly), round(excess, 1), sum(way.cost for way in ways)

    def advise(self, piece: Any, lying: Lying) -> str:
        """Say what to shorten where a piece does not fit and no cut makes it fit."""
        lengths = [self._length_in(piece, n) for n in range(len(self._solids))]
        length = max(lengths)
        longest = self._link.names[lengths.index(length)]
        words = macros("plugins.results.workshop", "words")
        return str(words.advise(lying, longest, length, REACH_MM[0] + 5))

    def _length_in(self, piece: Any, number: int) -> float:
        """How long a component is in a piece, mm."""
        shared = piece ^ self._solids[number]
        if shared.is_empty():
            return 0.0

        corners = shared.to_mesh().vert_properties[:, :3]
        turned = corners @ self._link.shapes[number][1].rotation_matrix
        return float(np.ptp(turned, axis=0).max())


def _slides(joint: Joint, below: Any, above: Any) -> bool:
    """Report whether the piece above can be drawn off its tongue."""
    for share in (0.5, 1.0):
        way = share * joint.reach_mm * joint.along
        if (above.translate(tuple(way)) ^ below).volume() > 1.0:
            return False

    return True


def _distinct(directions: Array) -> Array:
    """Return directions (N, 3) without those that are parallel to one before."""
    kept: list[Array] = []
    for direction in directions:
        if all(abs(direction @ other) < 0.999 for other in kept):
            kept.append(direction)

    return np.array(kept)
