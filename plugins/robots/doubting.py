"""Say what in an arm is possible, and yet hardly meant."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from core.values.descriptions import Description, RobotJoint
from core.values.doubts import find_doubt


def find_doubts(description: Description, arm: Sequence[RobotJoint]) -> Iterator[str]:
    """Yield a line for each mass, place and limit that is hardly meant."""
    for joint in arm:
        lower, upper = joint.range
        where = f"joint {joint.name!r}"
        yield from find_doubt(where, "range", upper - lower)
        yield from find_doubt(where, "speed", joint.limits.velocity or 0.0)

    for name, link in description.links.items():
        if link.inertial.mass:
            yield from find_doubt(f"link {name!r}", "link mass", link.inertial.mass)
    for name, borne in description.joints.items():
        away = float(np.linalg.norm(borne.origin.xyz))
        yield from find_doubt(f"link {name!r}", "offset", away)
