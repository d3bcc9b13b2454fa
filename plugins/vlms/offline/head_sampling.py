"""Draw a head for a subgoal: its family, and its measures by what is to be moved and what is around.

Bodies that must rise, or have something in their way, are lifted. Those that something is above are mostly hooked,
also past what is in their way, and all others mostly pushed. The families of heads are in `heads`.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from core.geometry import Array
from plugins.vlms.offline.boxes import LEVEL, UP
from plugins.vlms.offline.chance import Range, draw
from plugins.vlms.offline.detours import (
    find_detour,
    find_two_pushes,
    loses_ground,
    make_leader,
    make_two_pushes,
)
from plugins.vlms.offline.heads import (
    FINGER_OPEN,
    SIDES,
    Head,
    add_stem,
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

# Which head.
_STAYS_M = 0.03  # a shorter way on the ground is none
_GOES_AROUND = 0.5  # how often a body is led around what bars its way
_PUSHES_TWICE = 0.7  # how often it is pushed across and along, where no pen gets
_LIFTS_BARRED = 0.8  # how often bodies are lifted over what bars their way, which may yield or be passed
_LIFTS_FALLING = 0.3  # how often bodies that are to fall are lifted over the edge
_HOOKS_COVERED = 0.8  # how often bodies are hooked that something is above: most heads come from there
_HOOKS_OTHERS = 0.08
# How often each is drawn, in relation to the others.
_PUSHERS = {"blade": 2.0, "peg": 0.7}
_ENCLOSERS = {"cage": 3.0, "pen": 1.2, "funnel": 1.0, "wedge": 1.0, "rake": 0.7}
_ENCLOSER_ROOM_M = 0.02  # beside bodies, for walls around them
_PASS_M = 0.002  # a head is narrower than the room for it

# Pads of fingers. A hand closes by 0.08 m, and pads begin a little outside of bodies.
_PAD_ROOM_M = 0.01  # between bodies and open pads, both together, at least
# At most: the rest of the way is what pads press with.
_MOST_PAD_ROOM_M = min(0.06, 2 * FINGER_OPEN - 0.01)
# In a container there is little clearance beside them.
_TIGHT_ROOM_M = Range(0.006, 0.025)
_PAD_THICK_M = Range(0.006, 0.014)
_PAD_LENGTH = Range(0.3, 1.2)  # of the bodies'
_TIGHT_LENGTH = Range(0.15, 0.4)  # in a container
_PAD_HEIGHT = Range(0.5, 1.3)  # of the bodies'
_LEAST_PAD_M = 0.012  # long, to hold what is thin by its width
# Neither too low to hold, nor so high that it meets the hand.
_PAD_HEIGHTS_M = (0.02, 0.12)

# Heads that push.
_WALL_M = Range(0.004, 0.012)  # thick, of the stiff default material
_HEIGHT = Range(0.5, 1.3)  # of the bodies'
# No lower than a shaft is thick, no higher than a shaft is stiff.
_HEIGHTS_M = (0.02, 0.15)
_SPARE_M = Range(0.004, 0.04)  # between bodies and the walls around them, on each side
_LEAST_M = 0.003  # clearance between a head and the bodies inside it
_BLADE_WIDTH = Range(0.7, 2.0)  # of the bodies'
_PEG_M = Range(0.012, 0.035)  # wide
_PEG_THICK_M = 0.02  # at most
_CAGE_DEPTH = Range(0.4, 1.1)  # of the bodies' length
_FUNNEL_DEPTH = Range(0.4, 1.0)
_SPLAY_RAD = Range(0.1, 0.6)  # what opens by less gathers no more than a cage
# Between a wing and the motion: narrower, bodies jam, and wider, they slip out.
_WEDGE_RAD = Range(0.6, 1.2)
_WING = Range(0.6, 1.2)  # of the bodies' width that a wing covers
_RAKE_WIDTH = Range(1.0, 1.6)  # of the bodies'
_RAKE_GAP = 0.6  # of the smallest side of a body: it does not pass between tines

# Heads that lift.
_LIFTER_HEIGHT = Range(0.7, 1.3)  # of the bodies': the wall that they lean on
_LIFTER_HEIGHTS_M = (0.02, 0.2)
_LIFTER_DEPTH = Range(0.75, 1.15)  # of the bodies' length: their middle is above it
_LONG_M = 0.4  # a body that is longer across its way is lifted by less of it
_LONG_SHARE = Range(0.3, 1.0)  # of that length
_BY_OVERHANG = 0.8  # how often what has an overhang is carried by it
_THIN_FORKS = 0.2  # how often tines go under bodies, rather than a floor
_THIN_TINE = Range(0.08, 0.2)  # wide, in widths of the bodies
_THIN_INNER = Range(0.4, 0.7)  # between the outer ones, likewise
_MOST_TINES = 4
_TINE_M = 0.002  # thick
_BALL_ROOM_M = 0.02  # beside a ball, for tines to go below it
_ON_GROUND_M = 0.006  # what is no higher than a ball's foot bears it
_STRADDLES = 0.7  # how often tines go below a ball beside its foot
_STRADDLE_UNDER_M = 0.003  # that tines are above the ground
_STRADDLE = 0.6  # of a ball's radius, as high as tines are at most
_STRADDLE_ROOM = Range(1.02, 1.2)  # between tines, of what the ball is wide there
_STRADDLE_WIDEST = 1.8  # of its radius, or it falls through
_STRADDLE_DEPTH = Range(0.9, 1.2)  # of its width
_STRADDLE_TINE_M = 0.008
_NO_RAILS = 0.3  # how often a floor has none
_RAIL = Range(0.1, 0.6)  # high, in heights of the bodies
_FLOOR_ROOM_M = Range(0.005, 0.04)  # that a floor is wider than bodies
_LEAST_FLOOR = 0.6  # of their width, however little room there is
_FLOOR_M = Range(0.001, 0.003)  # thick: a body climbs onto it
_FORK_TINE = Range(0.5, 1.2)  # of the room below an overhang that a tine fills
_LEAST_FORK_TINE_M = 0.004
_FORK_THICK = Range(0.3, 0.7)  # of the overhang's height
_LEAST_THICK_M = 0.002
_MOST_THICK_M = 0.01
_BEAM_M = 0.015  # thick, in place of a light fork's wall
_BELOW_OVERHANG_M = Range(0.003, 0.02)  # to go in without touching it
# Between the bodies' foot and the tines, both together.
_FORK_ROOM_M = Range(0.004, 0.016)

# Hooks.
# How long a hook's arm is at most past covered bodies, in lengths of their way.
_HOOK_WAY = 1.4
_HOOK_AHEAD_M = 0.1  # and past others
_LEAST_AHEAD_M = 0.02
_COVERED_WAY = Range(0.9, _HOOK_WAY)  # of covered bodies
# A hook's arm is at least this thick, as a share of its length. A square bar of steel, half a metre long and this
# thick, bends by 4 mm under 1 N: F L^3 / (3 E I), with I = t^4 / 12. The rules allow 10 mm, with what carries it.
_HOOK_STOUTNESS = 0.01
_LEAST_ARM_M = 0.003
_MOST_ARM_M = 0.014
# Of the clearance beside bodies: the rest is for the toe, and for errors.
_ARM = Range(0.1, 0.25)
_ARM_GAP = 0.1  # of that clearance, between arm and bodies
_MOST_ARM_GAP_M = 0.004
_TOE = Range(0.5, 0.9)  # of the clearance that is left
_LEAST_TOE_M = 0.004
_BEHIND = Range(0.5, 1.0)  # of what a toe is behind, at most
_TOE_BREADTH = Range(0.4, 0.9)  # of the bodies' side
_MOST_ROOM_M = 0.1  # more clearance on a side makes it no likelier
_NO_ROOM_M = 1e-3  # a side without clearance is chosen seldom, and not never


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
    gap = extent.across + rng.uniform(_PAD_ROOM_M, _MOST_PAD_ROOM_M)

    thick = _PAD_THICK_M.draw(rng)
    length = extent.along * _PAD_LENGTH.draw(rng)

    if subgoal.is_enclosed:
        gap = extent.across + _TIGHT_ROOM_M.draw(rng)
        thick = thick / 2
        length = extent.along * _TIGHT_LENGTH.draw(rng)

    height = np.clip(subgoal.height * _PAD_HEIGHT.draw(rng), *_PAD_HEIGHTS_M)
    size = (max(_LEAST_PAD_M, length), thick, height)

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
    lightness: float = 1.0,
) -> Head:
    """Draw a head of a suitable family at random, sized by the bodies.

    Args:
        subgoal: what is to be moved.
        rng: random numbers.
        thickness_factor: how many times as thick as of the stiff default material walls are.
        lightness: the share of their measures that parts keep, where bodies do not need all; 1: not for its weight.
    """
    falls = subgoal.falls
    # A body that falls is pushed horizontally and goes down by itself.
    way = subgoal.shift * LEVEL if falls else subgoal.shift
    barred = subgoal.length > _STAYS_M and (
        subgoal.is_blocked(way) or loses_ground(subgoal)
    )

    if barred and not (falls or subgoal.rises) and len(subgoal.solids) == 1:
        detour = find_detour(subgoal)
        if detour is not None and rng.random() < _GOES_AROUND:
            return make_leader(subgoal, detour, rng)

        legs = find_two_pushes(subgoal) if detour is None else None
        if legs is not None and rng.random() < _PUSHES_TWICE:
            return make_two_pushes(subgoal, legs, rng)

    drawing = _HeadDrawing(subgoal, rng, thickness_factor, lightness)
    # Below a roof nothing comes down, nor is anything lifted over what bars its way.
    may_lift = not subgoal.is_covered
    lifts = (
        subgoal.rises
        or (barred and may_lift and rng.random() < _LIFTS_BARRED)
        or (falls and rng.random() < _LIFTS_FALLING)
    )

    if lifts:
        return drawing.draw_lifter()
    hooks = _HOOKS_COVERED if subgoal.is_covered else _HOOKS_OTHERS
    if rng.random() < hooks:
        return drawing.draw_hook()

    return drawing.draw_pusher()


class _HeadDrawing:
    """Draws heads of three kinds for a subgoal: what pushes, lifts or hooks its bodies.

        drawing = _HeadDrawing(subgoal, rng, thickness_factor=1.0, lightness=1.0)
        head = drawing.draw_pusher()

    Each call draws another head. All lengths are in metres.
    """

    def __init__(
        self,
        subgoal: Subgoal,
        rng: Generator,
        thickness_factor: float,
        lightness: float,
    ) -> None:
        """Measure the bodies along the way that they have to go, and the room beside them.

        Args:
            subgoal: what is to be moved.
            rng: random numbers.
            thickness_factor: see `draw_head`.
            lightness: see `draw_head`.
        """
        self._subgoal = subgoal
        self._rng = rng
        self._factor = thickness_factor
        self._lightness = lightness

        extent = subgoal.extent(subgoal.heading)
        self._along = extent.along
        self._across = extent.across

        self._clearances = subgoal.side_clearances(subgoal.heading)
        # of a head that moves behind the bodies
        self._widest = extent.across + 2 * min(self._clearances) - _PASS_M

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
        thick = self._factor * _WALL_M.draw(rng)

        height = self._subgoal.height * _HEIGHT.draw(rng) * self._lightness
        height = np.clip(height, *_HEIGHTS_M)

        kinds = _PUSHERS
        spare = _SPARE_M.draw(rng)

        # What encloses needs room for its walls.
        if self._widest > across + _ENCLOSER_ROOM_M:
            kinds = _PUSHERS | _ENCLOSERS
            widest_spare = (self._widest - across) / 2 - thick
            spare = max(_LEAST_M, min(spare, widest_spare))

        inside = across + 2 * spare

        match draw(kinds, rng):
            case "blade":
                width = min(self._widest, across * _BLADE_WIDTH.draw(rng))
                return make_blade(width, height, thick)

            case "peg":
                side = min(self._widest, _PEG_M.draw(rng))
                return make_blade(side, height, min(side, _PEG_THICK_M))

            case "cage":
                depth = self._along * _CAGE_DEPTH.draw(rng)
                return make_cage(inside, depth, height, thick)

            case "pen":
                return make_pen(inside, self._along + 2 * spare, height, thick)

            case "funnel":
                depth = self._along * _FUNNEL_DEPTH.draw(rng)
                splay = _SPLAY_RAD.draw(rng)
                return make_cage(inside, depth, height, thick, splay)

            case "wedge":
                half_angle = _WEDGE_RAD.draw(rng)
                wing = across * _WING.draw(rng) / np.sin(half_angle)
                return make_wedge(wing, half_angle, height, thick)

            case _:
                width = min(self._widest, across * _RAKE_WIDTH.draw(rng))
                gap = _RAKE_GAP * self._smallest_side()
                return make_rake(width, height, thick, gap)

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
        height = self._subgoal.height * _LIFTER_HEIGHT.draw(rng)
        height = np.clip(height, *_LIFTER_HEIGHTS_M)

        share = max(_LIFTER_DEPTH.low, _LIFTER_DEPTH.draw(rng) * self._lightness)
        depth = self._along * share

        # Tines beside the foot carry the overhang, without going under the bodies.
        overhangs, halves = self._subgoal.overhang(self._subgoal.heading)

        if overhangs.any() and rng.random() < _BY_OVERHANG:
            lowest = self._subgoal.boxes.bounds[0][:, 2]
            under = lowest[overhangs].min() - self._subgoal.lower[2]
            foot = ~overhangs & (lowest < self._subgoal.lower[2] + under)
            return self._draw_fork(height, depth, halves[foot].max(), under)

        radius = self._find_radius()
        if radius is not None and rng.random() < _STRADDLES:
            return self._draw_straddler(radius, height)

        # What is long across is lifted in its middle.
        across = self._across
        if len(self._subgoal.solids) == 1 and across > _LONG_M:
            across = _LONG_SHARE.draw(rng) * _LONG_M

        # Thin tines under the bodies.
        if rng.random() < _THIN_FORKS:
            tine = across * _THIN_TINE.draw(rng)
            inner = across * _THIN_INNER.draw(rng)

            count = int(rng.integers(2, _MOST_TINES + 1))
            thin = self._factor * _TINE_M
            return self._make_fork(inner, depth, height, tine, thin, count)

        # A floor under the bodies, most often between rails.
        rail = 0.0
        if rng.random() >= _NO_RAILS:
            rail = self._subgoal.height * _RAIL.draw(rng)

        width = across + _FLOOR_ROOM_M.draw(rng)
        width = min(width, max(self._widest, _LEAST_FLOOR * across))
        thick = self._factor * _FLOOR_M.draw(rng)

        if self._lightness == 1.0:
            return make_scoop(width, depth, height, rail, thick)

        low = max(_LIFTER_HEIGHTS_M[0], height * self._lightness)
        scoop = make_scoop(width, depth, low, rail, thick)
        return add_stem(scoop, height, self._factor * _BEAM_M)

    def _find_radius(self) -> float | None:
        """Return the radius of the only body, a ball that lies free, metres; None: there is no such ball alone."""
        subgoal = self._subgoal
        lower, upper = subgoal.obstacles.bounds
        beside = lower < subgoal.upper + _BALL_ROOM_M * LEVEL
        beside &= upper > subgoal.lower - _BALL_ROOM_M * LEVEL + _ON_GROUND_M * UP
        if len(subgoal.solids) > 1 or beside.all(axis=1).any():
            return None

        shapes = [geom.shape for geom in subgoal.solids[0].body.collisions]
        if len(shapes) == 1 and shapes[0].is_ball:
            return shapes[0].ball_radius

        return None

    def _draw_straddler(self, radius: float, height: float) -> Head:
        """Draw a fork whose tines go below a ball beside where it touches the ground: it would roll from a floor.

        Args:
            radius: of the ball.
            height: of the fork's wall.
        """
        rng = self._rng
        thick = self._factor * _TINE_M
        top = min(thick + _STRADDLE_UNDER_M, _STRADDLE * radius)
        inner = 2 * np.sqrt(radius**2 - (radius - top) ** 2) * _STRADDLE_ROOM.draw(rng)
        inner = min(inner, _STRADDLE_WIDEST * radius)
        depth = 2 * radius * _STRADDLE_DEPTH.draw(rng)

        return self._make_fork(inner, depth, height, _STRADDLE_TINE_M, thick)

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
        tine = (self._across / 2 - foot_half) * _FORK_TINE.draw(rng)

        # They fit below the overhang, and are as high as they can be.
        thick = under * _FORK_THICK.draw(rng)
        thick = np.clip(thick, _LEAST_THICK_M, self._factor * _MOST_THICK_M)
        level = max(0.0, under - thick - _BELOW_OVERHANG_M.draw(rng))
        inner = 2 * foot_half + _FORK_ROOM_M.draw(rng)
        tine = max(_LEAST_FORK_TINE_M, tine * self._lightness)

        return self._make_fork(inner, depth, height, tine, thick, level=level)

    def _make_fork(
        self,
        inner: float,
        depth: float,
        height: float,
        tine: float,
        thick: float,
        count: int = 2,
        level: float = 0.0,
    ) -> Head:
        """Make a fork, with the arguments of `make_fork`; a light one has a beam with a stem in place of its wall."""
        if self._lightness == 1.0:
            return make_fork(inner, depth, height, tine, thick, count, level)

        beam = self._factor * _BEAM_M
        fork = make_fork(inner, depth, beam, tine, thick, count, level, back=beam)
        return add_stem(fork, max(height, beam), beam)

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

        least = max(_LEAST_ARM_M, _HOOK_STOUTNESS * longest)
        thick = clearance * self._factor * _ARM.draw(rng)
        thick = np.clip(thick, least, self._factor * _MOST_ARM_M)

        gap = min(_MOST_ARM_GAP_M, _ARM_GAP * clearance)

        # The toe takes what room is left, and grips up to all of the bodies' side.
        behind = subgoal.height if passes_over else self._across
        toe = (clearance - thick - gap) * _TOE.draw(rng)
        toe = np.clip(toe, _LEAST_TOE_M, behind * _BEHIND.draw(rng))

        breadth = self._across if passes_over else subgoal.height
        breadth *= _TOE_BREADTH.draw(rng)

        # Where something is above, the whole way is under it.
        if subgoal.is_covered:
            length = self._along + subgoal.length * _COVERED_WAY.draw(rng)
        else:
            length = self._along + rng.uniform(_LEAST_AHEAD_M, _HOOK_AHEAD_M)

        return make_hook(length, toe, breadth, thick, gap, outward)

    def _draw_hook_side(self) -> tuple[float, Array]:
        """Draw the side on which a hook's arm passes, more likely where there is more clearance.

        Returns:
            The clearance there, metres; and a unit vector (3,) from the bodies to the arm.
        """
        clearances = np.array([*self._clearances, self._subgoal.clearance_above])
        weights = np.minimum(clearances, _MOST_ROOM_M) + _NO_ROOM_M
        chosen = self._rng.choice(3, p=weights / weights.sum())
        outward = np.array([(0.0, -1.0, 0.0), (0.0, 1.0, 0.0), UP])

        return clearances[chosen], outward[chosen]
