"""Remember from which side a solid got into another, and how far in along that direction.

The least way out of a body does not show that a thin sheet cuts through it: of a sheet in its lowest layer, the least
way out is downward, and no longer than the sheet is thick. Covered by `tests/core/simulation/test_entry.py`.
"""

from __future__ import annotations

from core.geometry import Array
from core.simulation.gaps import spans
from core.simulation.tracks import ROBOT, Track

CUT_M = (0.001, 0.003)  # so much farther in than the least way out: twice the thickness, within these limits
# Two solids only touch while they are no deeper than this share of the thinner one's thickness, and this depth: one of
# them the robot's, or two bodies, which may fall onto a thin wall at 4 m/s, 10 mm in an engine's step.
SKIN, SKIN_M = 0.3, 0.005
BODY_SKIN, BODY_SKIN_M = 0.5, 0.01
SAME = 0.9  # cosine of two directions that are about the same


def thickness(one: Track, other: Track) -> float:
    """The thickness of the thinner one, metres."""
    return 2 * min(one.half_width, other.half_width)


def cut(one: Track, other: Track) -> float:
    """How much farther in than the least way out, metres, is a cut."""
    return min(max(2 * thickness(one, other), CUT_M[0]), CUT_M[1])


def skin(one: Track, other: Track) -> float:
    """The depth, metres, below which two solids only touch: the side that each is on is clear."""
    if one.owner == ROBOT:
        return min(SKIN_M, SKIN * thickness(one, other))
    return min(BODY_SKIN_M, BODY_SKIN * thickness(one, other))


class Side:
    """The direction out of one solid for another when they last only touched, in the frame of either."""

    def __init__(self, direction: Array, rotation: Array, others_rotation: Array) -> None:
        self._own, self._others = direction @ rotation, direction @ others_rotation

    def same(self, direction: Array, rotation: Array, others_rotation: Array) -> bool:
        """Report whether a direction out is still about the same, for either solid: they roll on each other."""
        own, others = float(direction @ rotation @ self._own), float(direction @ others_rotation @ self._others)
        return max(own, others) > SAME

    def overlap(self, one: Track, other: Track, k: int, share: float) -> float:
        """How far the first would have to go back along that direction until the two are apart, at most, metres.

        It is the smaller one of two: the direction may have turned with either solid. ``k`` and ``share`` are an
        instant as in `Track.at`.
        """
        (at, rotation), (others_at, others_rotation) = one.at(k, share), other.at(k, share)
        apart = at.getTranslation() - others_at.getTranslation()
        depths = []
        for direction in (rotation @ self._own, others_rotation @ self._others):
            far = _extent(one, -(direction @ rotation)) + _extent(other, direction @ others_rotation)
            depths.append(far - float(apart @ direction))
        return min(depths)


def _extent(track: Track, direction: Array) -> float:
    return float(spans(track, direction[None, :, None])[1][0, 0])
