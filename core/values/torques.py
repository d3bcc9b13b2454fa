"""Say how much of its torque a joint of the arm used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

HIGH = 0.8
"""Beyond this share of its limit a joint is said to be near it, as an export's checklist does."""


@dataclass(frozen=True)
class TorqueShare:
    """The greatest share of its torque limit that a joint used, in one step of an engine."""

    joint: str
    share: float

    def __str__(self) -> str:
        return f"{self.joint} used {100 * self.share:.0f} % of its torque"

    @property
    def is_high(self) -> bool:
        return self.share > HIGH


def find_hardest(shares: Mapping[str, float]) -> TorqueShare | None:
    """Find the joint that used the greatest share, of those by name; None: there are none."""
    if not shares:
        return None

    joint = max(shares, key=lambda name: shares[name])
    return TorqueShare(joint, shares[joint])
