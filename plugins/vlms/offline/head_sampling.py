"""Draw a head for a subgoal: its family, and its measures by what is to be moved and what is around.

Bodies that must rise, or have something in their way, are lifted. Those that something is above are mostly hooked, all
others mostly pushed. The families of heads are in `heads`.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from core.geometry import Array
from plugins.vlms.offline.boxes import LEVEL, UP
from plugins.vlms.offline.chance import draw
from plugins.vlms.offline.heads import (
    FINGER_OPEN,
    SIDES,
    Head,
    make_blade,
    make_cage,
    make_fork,
    make_hook,
    make_pen,
    make_piece,
    make_rake,
    make_scoop,
    make_wedge,
)
from plugins.vlms.offline.subgoals import Subgoal

_LONG_M = 0.4  # a body that is longer across its way is lifted by less of it
_LEAST_M = 0.003  # clearance between a head and the bodies inside it
_HOOK_WAY = (
    1.4  # how long a hook's arm is at most past covered bodies, in lengths of their way
)
_HOOK_AHEAD_M = 0.1  # and past others
# A hook's arm is at least this thick, as a share of its length. A square bar of steel, half a metre long and this
# thick, bends by 4 mm under 1 N: F L^3 / (3 E I), with I = t^4 / 12. The rules allow 10 mm, with what carries it.
_HOOK_STOUTNESS = 0.01


def draw_clamp(subgoal: Subgoal, rng: Generator) -> Head:
    """Draw two pads, a little farther apart than the bodies are wide, that close by twice the fingers' travel.

    In a container the pads are thin, short, and near the bodies.

    Args:
        subgoal: what is to be moved.
        rng: random numbers.
    Returns:
        A head with a pad for each finger.
    """
    extent = subgoal.extent(subgoal.grip_heading)
    gap = extent.across + rng.uniform(0.01, min(0.06, 2 * FINGER_OPEN - 0.01))

    thick = rng.uniform(0.006, 0.014)
    length = extent.along * rng.uniform(0.3, 1.2)

    if subgoal.is_enclosed:  # there is little clearance beside them
        gap = extent.across + rng.uniform(0.006, 0.025)
        thick = thick / 2
        length = extent.along * rng.uniform(0.15, 0.4)

    # Neither too low to hold, nor so high that it meets the hand.
    height = np.clip(subgoal.height * rng.uniform(0.5, 1.3), 0.02, 0.12)
    size = (max(0.012, length), thick, height)

    pads = []

    for name, side in SIDES:  # the left finger is at the negative y
        y = -side * (gap + thick) / 2
        pads.append(make_piece(f"{name}_pad", 0.0, y, height / 2, size))

    attachment = np.array([0.0, (gap + thick) / 2, height])

    return Head("clamp", "clamp", tuple(pads), attachment, size[0] / 2, gap)


def draw_head(
    subgoal: Subgoal,
    rng: Generator,
    thickness_factor: float,
) -> Head:
    """Draw a head of a suitable family at random, sized by the bodies.

    Args:
        subgoal: what is to be moved.
        rng: random numbers.
        thickness_factor: how many times as thick as of the stiff default material walls are.
    """
    falls = subgoal.shift[2] < -0.1
    # A body that falls is pushed horizontally and goes down by itself.
    way = subgoal.shift * LEVEL if falls else subgoal.shift
    barred = subgoal.length > 0.03 and subgoal.is_blocked(way)

    drawing = _HeadDrawing(subgoal, rng, thickness_factor)
    lifts = (
        subgoal.rises
        or (barred and rng.random() < 0.8)
        or (falls and rng.random() < 0.3)
    )

    if lifts:
        return drawing.draw_lifter()
    if rng.random() < (0.8 if subgoal.is_covered else 0.08):
        return drawing.draw_hook()

    return drawing.draw_pusher()


class _HeadDrawing:
    """Draws heads of three kinds for a subgoal: what pushes, lifts or hooks its bodies.

        drawing = _HeadDrawing(subgoal, rng, thickness_factor=1.0)
        head = drawing.draw_pusher()

    Each call draws another head. All lengths are in metres.
    """

    def __init__(
        self,
        subgoal: Subgoal,
        rng: Generator,
        thickness_factor: float,
    ) -> None:
        """Measure the bodies along the way that they have to go, and the room beside them.

        Args:
            subgoal: what is to be moved.
            rng: random numbers.
            thickness_factor: see `draw_head`.
        """
        self._subgoal = subgoal
        self._rng = rng
        self._factor = thickness_factor

        extent = subgoal.extent(subgoal.heading)
        self._along = extent.along
        self._across = extent.across

        self._clearances = subgoal.side_clearances(subgoal.heading)
        # of a head that moves behind the bodies
        self._widest = extent.across + 2 * min(self._clearances) - 0.002

    def draw_pusher(self) -> Head:
        """Draw a head that moves bodies horizontally, by its face or by enclosing them.

        Blades and pegs push at any place. What encloses bodies is only drawn where there is room for its walls beside
        them.

        Returns:
            A blade, a peg, a cage, a pen, a funnel, a wedge or a rake.
        """
        rng = self._rng
        across = self._across

        # Measures that all families have.
        thick = self._factor * rng.uniform(0.004, 0.012)

        height = self._subgoal.height * rng.uniform(0.5, 1.3)
        height = np.clip(height, 0.02, 0.15)

        kinds = {"blade": 2.0, "peg": 0.7}
        spare = rng.uniform(0.004, 0.04)

        # What encloses needs room for its walls.
        if self._widest > across + 0.02:
            kinds |= {
                "cage": 3.0,
                "pen": 1.2,
                "funnel": 1.0,
                "wedge": 1.0,
                "rake": 0.7,
            }

            widest_spare = (self._widest - across) / 2 - thick
            spare = max(_LEAST_M, min(spare, widest_spare))

        inside = across + 2 * spare

        match draw(kinds, rng):
            case "blade":
                width = min(self._widest, across * rng.uniform(0.7, 2.0))
                return make_blade(width, height, thick)

            case "peg":
                side = min(self._widest, rng.uniform(0.012, 0.035))
                return make_blade(side, height, min(side, 0.02))

            case "cage":
                depth = self._along * rng.uniform(0.4, 1.1)
                return make_cage(inside, depth, height, thick)

            case "pen":
                return make_pen(inside, self._along + 2 * spare, height, thick)

            case "funnel":
                depth = self._along * rng.uniform(0.4, 1.0)
                return make_cage(
                    inside, depth, height, thick, splay=rng.uniform(0.1, 0.6)
                )

            case "wedge":
                half_angle = rng.uniform(0.6, 1.2)
                wing = across * rng.uniform(0.6, 1.2) / np.sin(half_angle)
                return make_wedge(wing, half_angle, height, thick)

            case _:
                width = min(self._widest, across * rng.uniform(1.0, 1.6))
                return make_rake(width, height, thick, 0.6 * self._smallest_side())

    def _smallest_side(self) -> float:
        """The least side of a body on the ground, metres."""
        return min(
            float(np.ptp(solid.points[:, :2], axis=0).min())
            for solid in self._subgoal.solids
        )

    def draw_lifter(self) -> Head:
        """Draw a head that goes under the bodies, or under their overhang if they have one.

        Under an overhang it is most often a fork whose tines go beside the bodies' foot; otherwise a scoop, or a fork
        with thin tines under the bodies.

        Returns:
            A fork or a scoop.
        """
        rng = self._rng
        height = self._subgoal.height * rng.uniform(0.7, 1.3)
        height = np.clip(height, 0.02, 0.2)

        depth = self._along * rng.uniform(0.75, 1.15)

        # Tines beside the foot carry the overhang, without going under the bodies.
        overhangs, halves = self._subgoal.overhang(self._subgoal.heading)

        if overhangs.any() and rng.random() < 0.8:
            lowest = self._subgoal.boxes.bounds[0][:, 2]
            under = lowest[overhangs].min() - self._subgoal.lower[2]
            foot = ~overhangs & (lowest < self._subgoal.lower[2] + under)
            return self._draw_fork(height, depth, halves[foot].max(), under)

        # What is long across is lifted in its middle.
        across = self._across
        if len(self._subgoal.solids) == 1 and across > _LONG_M:
            across = rng.uniform(0.3, 1.0) * _LONG_M

        # Thin tines under the bodies.
        if rng.random() < 0.2:
            tine = across * rng.uniform(0.08, 0.2)
            inner = across * rng.uniform(0.4, 0.7)

            count = int(rng.integers(2, 5))
            return make_fork(inner, depth, height, tine, self._factor * 0.002, count)

        # A floor under the bodies, most often between rails.
        rail = 0.0
        if rng.random() >= 0.3:
            rail = self._subgoal.height * rng.uniform(0.1, 0.6)

        width = across + rng.uniform(0.005, 0.04)
        width = min(width, max(self._widest, 0.6 * across))
        thick = self._factor * rng.uniform(0.001, 0.003)

        return make_scoop(width, depth, height, rail, thick)

    def _draw_fork(
        self,
        height: float,
        depth: float,
        foot_half: float,
        under: float,
    ) -> Head:
        """Draw a fork with a tine on each side of the bodies' foot.

        Args:
            height: of its wall.
            depth: of its tines.
            foot_half: half the width of the foot.
            under: height of the overhang above the foot.
        """
        rng = self._rng
        tine = (self._across / 2 - foot_half) * rng.uniform(0.5, 1.2)

        # They fit below the overhang, and are as high as they can be.
        thick = under * rng.uniform(0.3, 0.7)
        thick = np.clip(thick, 0.002, self._factor * 0.01)
        level = max(0.0, under - thick - rng.uniform(0.003, 0.02))
        inner = 2 * foot_half + rng.uniform(0.004, 0.016)

        return make_fork(inner, depth, height, max(0.004, tine), thick, level=level)

    def draw_hook(self) -> Head:
        """Draw a head that passes beside or over the bodies, and pulls them from behind.

        Its arm is as stiff as its length asks for, and clear of the bodies; its toe is in what room is left.

        Returns:
            A hook, whose arm is at one of the bodies' sides or above them.
        """
        rng = self._rng
        subgoal = self._subgoal

        clearance, outward = self._draw_hook_side()
        passes_over = outward[2] > 0.5

        longest = self._along + _HOOK_AHEAD_M

        if subgoal.is_covered:
            longest = self._along + _HOOK_WAY * subgoal.length

        least = max(0.003, _HOOK_STOUTNESS * longest)
        thick = clearance * self._factor * rng.uniform(0.1, 0.25)
        thick = np.clip(thick, least, self._factor * 0.014)

        gap = min(0.004, 0.1 * clearance)

        # The toe takes what room is left, and grips up to all of the bodies' side.
        behind = subgoal.height if passes_over else self._across
        toe = (clearance - thick - gap) * rng.uniform(0.5, 0.9)
        toe = np.clip(toe, 0.004, behind * rng.uniform(0.5, 1.0))

        breadth = self._across if passes_over else subgoal.height
        breadth *= rng.uniform(0.4, 0.9)

        # Where something is above, the whole way is under it.
        if subgoal.is_covered:
            length = self._along + subgoal.length * rng.uniform(0.9, _HOOK_WAY)
        else:
            length = self._along + rng.uniform(0.02, _HOOK_AHEAD_M)

        return make_hook(length, toe, breadth, thick, gap, outward)

    def _draw_hook_side(self) -> tuple[float, Array]:
        """Draw the side on which a hook's arm passes, more likely where there is more clearance.

        Returns:
            The clearance there, metres; and a unit vector (3,) from the bodies to the arm.
        """
        clearances = np.array([*self._clearances, self._subgoal.clearance_above])
        weights = np.minimum(clearances, 0.1) + 1e-3
        chosen = self._rng.choice(3, p=weights / weights.sum())
        outward = np.array([(0.0, -1.0, 0.0), (0.0, 1.0, 0.0), UP])

        return clearances[chosen], outward[chosen]
