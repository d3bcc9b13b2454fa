"""Draw a tool for a subgoal: the head that suits, and the shaft that carries it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from core.design import Tool
from core.geometry import Pose
from core.interfaces import PAPER, Brief
from plugins.vlms.offline.below_roof import (
    goes_below,
    make_reaching_clamp,
    make_shelver,
)
from plugins.vlms.offline.catching import make_catcher, needs_catcher
from plugins.vlms.offline.chance import Range
from plugins.vlms.offline.clips import find_rims, make_clip_lifter, make_clip_pourer
from plugins.vlms.offline.cups import draw_cup, suits_cup
from plugins.vlms.offline.guided import make_guided_head, needs_guided_head
from plugins.vlms.offline.hand_turning import make_turning_clamp, turns_in_hand
from plugins.vlms.offline.hanging import find_way_onto_peg, find_ways
from plugins.vlms.offline.head_sampling import draw_clamp, draw_head
from plugins.vlms.offline.heads import Head
from plugins.vlms.offline.ladling import find_vessel, make_ladle
from plugins.vlms.offline.mounting import works_above_home
from plugins.vlms.offline.paths import HeadPath
from plugins.vlms.offline.pouring import find_handles, make_pourer
from plugins.vlms.offline.reaching_in import (
    find_bow_points,
    find_handle_points,
    join_rods,
    make_bow_carrier,
    make_handle_lifter,
    make_straight_mover,
)
from plugins.vlms.offline.subgoals import Subgoal
from plugins.vlms.offline.tool_building import (
    Shaft,
    build_clamp,
    build_pourer,
    build_tool,
)

_CATCHES = 0.9  # how often what moves by itself is waited for
_GUIDED = 0.85  # how often a guided head is chosen where one suits
_GUIDED_FINGER = 0.5  # and on one finger of a gripper
_TURNS_IN_HAND = 0.8  # how often a body that is to be turned is turned between pads
_IN_PLACE_M = 0.03  # a shorter way on the ground is none
_ROD_TRIES = 4  # of one rod for several subgoals
# Everything near, where one rod turns from one body to the next: in other layouts it may be higher.
_ABOVE_M = 0.12
_STRAIGHT = 0.4  # how often such a head is chosen for a handle, or for what is deep in something:
_DEEP_M = 0.25  # lower than things near it by more, so that no shaft comes down to it
_BY_BOW = 0.7  # how often a body that has a bow over its middle is carried by it
_POURS = 0.8  # how often a container is turned over that bodies are in
_LADLES = 0.8  # how often what lies in a fixed vessel is scooped out of it
_CLIPS = 0.5  # how often an open vessel hangs from a clip on its rim
_CLIPS_STEADY = 0.9  # and one that must not tilt
_CUPS = 0.6  # how often what stands flat is tipped into a cup
_BELOW = 0.8  # how often a body is brought in below something
_CLAMPS = 0.5  # how often a gripper has pads that close on bodies, rather than a head on one finger
_CLAMPS_INTO = 0.9  # how often where bodies leave or enter what is around them: a hand alone gets there
_SHAFT_KINDS = ("gantry", "slope", "elbow")
_SHAFTS = [0.6, 0.2, 0.2]  # how often each is drawn
# A bar's stiffness is that of its material times its thickness to the power of 4: the fourth root would make up for a
# softer material, and the eighth makes up for half of that, in its logarithm. The rules allow some bending.
_THICKER = 0.125
# Thick: it bends by little under what the arm bears, and weighs little.
_SHAFT_M = Range(0.012, 0.024)
_HEAVY = 3  # where so many tools were too heavy, that is no chance
# What a drawer's lightness is multiplied by after each tool that is too heavy.
_LIGHTER = 0.85
# What is thinner bends too far, and what is lower or narrower does little.
_LEAST_LIGHTNESS = 0.4
_THIN_SHAFT_M = 0.012  # where it reaches into a container, or no pad is as high as what it holds, at most
_JIB_M = Range(0.01, 0.06)  # above the bodies
# Of the way to the head, at which a shaft goes up: clear of the arm and of the bodies.
_BEND = Range(0.25, 0.6)


class DesignDrawer:
    """Draws the head and the shaft of one tool for a brief.

    A drawer makes up its mind once whether the tool has a guided head, where one suits.

    Attributes:
        thickness_factor: how many times as thick as of the stiff default material parts are, so that they bend little.
        lightness: the share of their measures that parts keep, where bodies do not need all; 1: not for its weight.
    """

    def __init__(self, brief: Brief, rng: Generator) -> None:
        material = brief.representation.material
        ratio = PAPER.young_pa / material.young_pa
        self.thickness_factor = max(1.0, ratio**_THICKER)
        self.lightness = 1.0
        self._heavy = 0  # tools so far
        self._gripper = brief.gripper
        self._rng = rng
        self._is_guided: bool | None = None

    def draw_head_for_all(self, subgoals: Sequence[Subgoal]) -> Head:
        """Draw a head for the subgoal with the most bodies, or a rod for all of them, where rods can do them.

        Args:
            subgoals: in the order in which they are reached.
        """
        if len(subgoals) > 1 and all(needs_guided_head(part) for part in subgoals):
            height = _ABOVE_M + max(part.clear_height for part in subgoals)
            for _ in range(_ROD_TRIES):
                heads = [self.draw_head(subgoal) for subgoal in subgoals]
                rod = join_rods(heads, height)
                if rod is not None:
                    return rod

        return self.draw_head(max(subgoals, key=lambda part: len(part.solids)))

    def draw_head(self, subgoal: Subgoal) -> Head:
        """Draw a head that moves the subgoal's bodies."""
        if self._gripper:
            return self._draw_finger_head(subgoal)
        if needs_catcher(subgoal) and self._rng.random() < _CATCHES:
            return make_catcher(subgoal, self._rng)

        return (
            self._draw_hanger(subgoal)
            or self._draw_guided_head(subgoal)
            or self._draw_bow_carrier(subgoal)
            or self._draw_straight_head(subgoal)
            or self._draw_pourer(subgoal)
            or self._draw_ladle(subgoal)
            or self._draw_clip(subgoal)
            or self._draw_cup(subgoal)
            or self._draw_free_head(subgoal)
        )

    def _draw_finger_head(self, subgoal: Subgoal) -> Head:
        """Draw a head for a gripper: pads that close on the bodies, or one head on the left finger."""
        if subgoal.model.draws_up:  # pads hang from the hand
            return self._draw_free_head(subgoal)

        hanger = self._draw_hanger(subgoal)
        if hanger is not None:
            return hanger

        below = goes_below(subgoal) and self._rng.random() < _BELOW
        reaching = make_reaching_clamp(subgoal, self._rng) if below else None
        if reaching is not None:
            return reaching

        if turns_in_hand(subgoal) and self._rng.random() < _TURNS_IN_HAND:
            return make_turning_clamp(subgoal, self._rng)

        if needs_guided_head(subgoal) and self._rng.random() < _GUIDED_FINGER:
            head = make_guided_head(subgoal, self._rng)
            if head is not None:
                return head

        straight = self._draw_straight_head(subgoal) if subgoal.slides_out else None
        if straight is not None:
            return straight

        lifts_out = subgoal.is_enclosed and subgoal.rises
        clamps = _CLAMPS_INTO if lifts_out or subgoal.falls_in else _CLAMPS
        if self._rng.random() < clamps:
            return draw_clamp(subgoal, self._rng)

        return self._draw_free_head(subgoal)

    def _draw_free_head(self, subgoal: Subgoal) -> Head:
        """Draw a head for bodies that may be pushed, lifted or hooked from anywhere."""
        return draw_head(subgoal, self._rng, self.thickness_factor, self.lightness)

    def make_lighter(self) -> bool:
        """Draw lighter tools from now on, after one that is too heavy; False: not yet, or as light as can be."""
        self._heavy += 1
        if self._heavy < _HEAVY or self.lightness <= _LEAST_LIGHTNESS:
            return False

        self.lightness *= _LIGHTER
        return True

    def _draw_hanger(self, subgoal: Subgoal) -> Head | None:
        """Draw a clip for the rim of a vessel that is to hang on a peg; None: it is not, or it has no rim."""
        if subgoal.goal is None or len(subgoal.solids) > 1:
            return None
        if find_way_onto_peg(subgoal) is None or not find_rims(subgoal):
            return None

        return make_clip_lifter(subgoal, self._rng)

    def _draw_guided_head(self, subgoal: Subgoal) -> Head | None:
        """Draw a head for what leaves one way only; None: it is free, or there is no way in, or not this time."""
        if not needs_guided_head(subgoal):
            return None
        if self._is_guided is None:
            self._is_guided = self._rng.random() < _GUIDED

        return make_guided_head(subgoal, self._rng) if self._is_guided else None

    def _draw_straight_head(self, subgoal: Subgoal) -> Head | None:
        """Draw a head that gets in to a body or a handle, and moves it straight; None: there is no way, or no need.

        Nor is there one every time: other heads may do as well.
        """
        if subgoal.goal is None or len(subgoal.solids) > 1:
            return None

        in_place = subgoal.length < _IN_PLACE_M
        by_handle = subgoal.rises and in_place and not subgoal.goal.steady
        by_handle = by_handle and bool(find_handle_points(subgoal))
        is_deep = subgoal.height_around > _DEEP_M and not subgoal.is_covered
        is_deep = is_deep and not subgoal.rises
        slides = subgoal.slides_out

        if not (by_handle or is_deep or slides) or self._rng.random() >= _STRAIGHT:
            return None
        if by_handle:
            return make_handle_lifter(subgoal, self._rng)

        return make_straight_mover(subgoal, self._rng)

    def _draw_bow_carrier(self, subgoal: Subgoal) -> Head | None:
        """Draw a hook for a bow by which a body is carried to its place; None: it has none, or not this time."""
        goal = subgoal.goal
        if goal is None or goal.place is None or len(subgoal.solids) > 1:
            return None
        if subgoal.length < _IN_PLACE_M or not find_bow_points(subgoal):
            return None

        ways = find_ways(subgoal)
        is_free = ways is not None and ways.off.is_free and ways.on.is_free
        if not is_free or self._rng.random() >= _BY_BOW:
            return None

        return make_bow_carrier(subgoal, self._rng)

    def _draw_pourer(self, subgoal: Subgoal) -> Head | None:
        """Draw a head that pours from the bodies' loose container; None: they are in none, or not this time."""
        if subgoal.loose_container is None:
            return None

        handles = find_handles(subgoal)
        if self._rng.random() >= _POURS:
            return None
        if handles is None:
            return make_clip_pourer(subgoal, self._rng)

        return make_pourer(subgoal, handles, self._rng, self.thickness_factor)

    def _draw_ladle(self, subgoal: Subgoal) -> Head | None:
        """Draw a scoop for what lies in a fixed vessel; None: nothing does, or there is no room, or not this time."""
        vessel = find_vessel(subgoal)
        if vessel is None or self._rng.random() >= _LADLES:
            return None

        return make_ladle(subgoal, vessel, self._rng)

    def _draw_clip(self, subgoal: Subgoal) -> Head | None:
        """Draw a clip for the rim of a vessel that is to be carried; None: it is none, or not this time."""
        if subgoal.goal is None or len(subgoal.solids) > 1 or not find_rims(subgoal):
            return None
        if self._rng.random() >= (_CLIPS_STEADY if subgoal.goal.steady else _CLIPS):
            return None

        return make_clip_lifter(subgoal, self._rng)

    def _draw_cup(self, subgoal: Subgoal) -> Head | None:
        """Draw a cup for a body that must be lifted and that nothing gets below; None: it is none, or not this time."""
        suits = suits_cup(subgoal) and not needs_guided_head(subgoal)
        below = suits and goes_below(subgoal)
        if not suits or self._rng.random() >= (_BELOW if below else _CUPS):
            return None

        arguments = (subgoal, self._rng, self.thickness_factor)
        shelver = make_shelver(*arguments) if below else None
        return shelver or draw_cup(*arguments)

    def build(
        self,
        head: Head,
        pose: Pose,
        path: HeadPath,
        subgoal: Subgoal,
    ) -> Tool:
        """Build a tool with a shaft that is drawn.

        Args:
            head: of the tool.
            pose: of the head in the frame of the tool mount.
            path: of the head.
            subgoal: that the head was drawn for.
        """
        if head.primitive == "pour":
            return build_pourer(head, pose)

        rng = self._rng
        thickness = self.thickness_factor * _SHAFT_M.draw(rng)
        thickness *= np.sqrt(self.lightness)
        if head.mount_pose is not None and head.primitive != "clamp":
            return build_tool(head, pose, Shaft("slope", thickness), self._gripper)

        kind = _SHAFT_KINDS[rng.choice(3, p=_SHAFTS)]

        if head.primitive == "clamp":
            if subgoal.is_enclosed or head.motion is not None:
                thickness = min(thickness, _THIN_SHAFT_M)
            return build_clamp(head, pose, thickness)

        # To a ceiling the flange points ahead, and nothing is in the shaft's way.
        at_ceiling = subgoal.model.draws_up
        if at_ceiling or not works_above_home(path, subgoal.model):
            return build_tool(head, pose, Shaft(kind, thickness), self._gripper)

        # The jib passes over the bodies.
        above = max(subgoal.height + thickness, head.attachment[2])
        top = pose.position[2] + above + _JIB_M.draw(rng)
        bend = _BEND.draw(rng)
        riser = Shaft("riser", thickness, bend, top)
        return build_tool(head, pose, riser, self._gripper)
