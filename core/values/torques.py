"""Say how much of its torque a joint of the arm used."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class TorqueShare:
    """The greatest share of its torque limit that a joint used, in one step of an engine."""

    joint: str
    share: float

    def __str__(self) -> str:
        return f"{self.joint} used {100 * self.share:.0f} % of its torque"


def find_hardest(shares: Mapping[str, float]) -> TorqueShare | None:
    """Find the joint that used the greatest share, of those by name; None: there are none."""
    if not shares:
        return None

    joint = max(shares, key=lambda name: shares[name])
    return TorqueShare(joint, shares[joint])
