"""Remember from which side a solid got into another, and how far in along that direction.

The least way out of a body does not show that a thin sheet cuts through it: of a sheet in its lowest layer, the least
way out is downward, and no longer than the sheet is thick. Covered by `tests/core/solids/test_entry_side.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from core.geometry import Array
from core.solids.bodies import ROBOT, Solids
from core.solids.gap_bounds import spans
from core.solids.tracks import Pair, Track

DEEP_M = 0.01  # penetration allowed under pressure; at most half of what it takes to reach the other side
THIN_M = 0.003  # but for thin solids, pressed into a thick one too, as much as they are thick, and at least this much
THROUGH = 2 / 3  # share of the way to the middle that counts as a passage if the solid leaves on the other side
CUT_M = (0.001, 0.003)  # so much farther in than the least way out: twice the thickness, within these limits
# Two solids only touch while they are no deeper than this share of the thinner one's thickness, and this depth: one of
# them the robot's, or two bodies, which may fall onto a thin wall at 4 m/s, 10 mm in an engine's step.
SKIN, SKIN_M = 0.3, 0.005
BODY_SKIN, BODY_SKIN_M = 0.5, 0.01
SAME = 0.9  # cosine of two directions that are about the same


class Depths(NamedTuple):
    """How deep in each other, metres, two solids are when something begins; arrays (P,) for many pairs.

    Attributes:
        thick: as deep as the thinner one is thick.
        deep: from here on, it is too deep.
        through: from here on, they may have passed through each other.
        skin: up to here they only touch: the side that each is on is clear.
        cut: so much farther in than the least way out is a cut.
    """

    thick: Array
    deep: Array
    through: Array
    skin: Array
    cut: Array

    @classmethod
    def of(cls, solids: Solids, pairs: npt.NDArray[np.intp]) -> Depths:
        """Compute them for pairs (P, 2) of solids, of which the first one may be the robot's."""
        one, other = solids.widths[pairs.T]
        across, thick = one + other, 2 * np.minimum(one, other)
        robots = np.array([owner == ROBOT for owner in solids.owners])[pairs[:, 0]]
        pressed = np.minimum(across / 2, thick)
        return cls(
            thick,
            np.minimum(DEEP_M, np.maximum(pressed, np.minimum(THIN_M, 0.9 * across))),
            THROUGH * across,
            np.where(robots, np.minimum(SKIN_M, SKIN * thick), np.minimum(BODY_SKIN_M, BODY_SKIN * thick)),
            np.minimum(np.maximum(2 * thick, CUT_M[0]), CUT_M[1]),
        )

    @property
    def least(self) -> Array:
        """The least of what counts."""
        return np.minimum(np.minimum(self.deep, self.through), self.skin)


class Side:
    """The direction out of one solid for another when they last only touched, in the frame of either."""

    def __init__(self, direction: Array, rotation: Array, others_rotation: Array) -> None:
        self._own, self._others = direction @ rotation, direction @ others_rotation

    def same(self, direction: Array, rotation: Array, others_rotation: Array) -> bool:
        """Report whether a direction out is still about the same, for either solid: they roll on each other."""
        own, others = float(direction @ rotation @ self._own), float(direction @ others_rotation @ self._others)
        return max(own, others) > SAME

    def overlap(self, pair: Pair, k: int, share: float) -> float:
        """How far the first would have to go back along that direction until the two are apart, at most, metres.

        It is the smaller one of two: the direction may have turned with either solid. ``k`` and ``share`` are an
        instant as in `Track.at`.
        """
        one, other = pair.one, pair.other
        (here, rotation), (there, others_rotation) = one.at(k, share), other.at(k, share)
        apart = here.getTranslation() - there.getTranslation()
        depths = []
        for direction in (rotation @ self._own, others_rotation @ self._others):
            far = _extent(one, -(direction @ rotation)) + _extent(other, direction @ others_rotation)
            depths.append(far - float(apart @ direction))
        return min(depths)


def _extent(track: Track, direction: Array) -> float:
    return float(spans(track, direction[None, :, None])[1][0, 0])
