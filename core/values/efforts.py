"""Define what a design costs: the time of its motion, the mass of its tool, and how little room it leaves."""

from __future__ import annotations

import math
from dataclasses import dataclass

LEAST_S = 0.1  # less counts as this, as with mass
LEAST_KG = 0.001
NARROW = 0.1  # added to margins, so that those near 0 can be compared
CONFIDENCE = 0.95  # of `least_share`
HOLDS = 0.95  # the mean from which on a design holds: of rewards, or of what is solved
PERTURBED = "layouts with tool and bodies perturbed"
_ROUNDING = 1e-9  # of a sum of rewards


def holds(mean: float) -> bool:
    """Say whether a design with this mean holds: 19 of 20 layouts do, in whatever order they are added."""
    return mean >= HOLDS - _ROUNDING


def least_share(kept: float, lost: float) -> float:
    """Return the lower end of the one-sided 95 % interval of a share: so much is assured of another try.

    C. Clopper and E. Pearson, "The use of confidence or fiducial limits", Biometrika 26 (1934). It is also that of
    `scipy.stats.binomtest`, which takes whole numbers alone.

    Args:
        kept: what was kept in all tries together, of 1 in each.
        lost: the rest of them.
    """
    from scipy.special import betaincinv  # lists of parts import this file

    if kept <= 0:
        return 0.0

    return float(betaincinv(kept, lost + 1, 1 - CONFIDENCE))


@dataclass(frozen=True)
class Held:
    """In how many layouts a design held, of how many."""

    held: int = 0
    layouts: int = 0

    @property
    def fails_below(self) -> float:
        """The upper end of the 95 % interval of its chance of failure in a layout; 1 where none was tried."""
        return 1.0 - least_share(self.held, self.layouts - self.held)

    def words(self, where: str = "further layouts") -> str:
        """Say it in words."""
        percent = float(f"{100 * self.fails_below:.2g}")
        chance = f"chance of failure below {percent:g} % (95 %)"
        return f"holds in {self.held} of {self.layouts} {where}: {chance}"


@dataclass(frozen=True)
class Effort:
    """The effort of a design, over its trials.

    Attributes:
        motion_s: the mean time of the motion, s.
        mass_kg: the mass of the tool, kg.
        margin: the mean of each trial's least margin, 0..1, a negative one counted as 0; None: the task says none.

    Raises:
        ValueError: a number is not finite, or below 0.
    """

    motion_s: float
    mass_kg: float
    margin: float | None = None

    def __post_init__(self) -> None:
        for number in (self.motion_s, self.mass_kg, self.margin or 0.0):
            if not 0 <= number < math.inf:
                raise ValueError(
                    f"an effort has finite numbers from 0 on, got {number}"
                )
        if self.margin is not None and self.margin > 1:
            raise ValueError(f"a margin is at most 1, got {self.margin}")

    def saved(self, reference: Effort) -> float:
        """Compare with a reference: 1 is as good as it, 2 is twice as good in each respect; there is no upper bound.

        The geometric mean of three ratios: the reference's time by this one, its mass by this one, and this margin by
        the reference's, both plus `NARROW`. A margin that is not known on one side counts as equal.
        """
        faster = max(reference.motion_s, LEAST_S) / max(self.motion_s, LEAST_S)
        lighter = max(reference.mass_kg, LEAST_KG) / max(self.mass_kg, LEAST_KG)
        wider = 1.0
        if self.margin is not None and reference.margin is not None:
            wider = (NARROW + self.margin) / (NARROW + reference.margin)
        return float((faster * lighter * wider) ** (1 / 3))
