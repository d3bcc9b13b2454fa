"""Say what in an arm is possible, and yet hardly meant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from core.robot.meshes import solid_of
from core.values.descriptions import Description, RobotJoint, RobotLink
from core.values.warnings import find_warning

STRONG_WRIST = 110.0  # N m; the last joint of an arm that bears 20 kg has some 100


def find_warnings(
    description: Description, arm: Sequence[RobotJoint], whole: Description
) -> Iterator[str]:
    """Yield a line for each mass, place and limit that is hardly meant.

    ``whole`` has the links as they are simulated: joined where one is fixed to another, with hulls for meshes.
    """
    for joint in arm:
        if joint.kind == "prismatic":
            continue

        lower, upper = joint.range
        where = f"joint {joint.name!r}"
        yield from find_warning(where, "range", upper - lower)
        yield from find_warning(where, "speed", joint.limits.velocity or 0.0)
        yield from find_warning(where, "effort", joint.limits.effort or 0.0)

    yield from _warn_of_wrist(arm)

    for name, link in description.links.items():
        if link.inertial.mass:
            yield from find_warning(f"link {name!r}", "link mass", link.inertial.mass)

    for name, borne in description.joints.items():
        away = float(np.linalg.norm(borne.origin.xyz))
        yield from find_warning(f"link {name!r}", "offset", away)
        turn = float(np.abs(borne.origin.rpy).max())
        yield from find_warning(f"link {name!r}", "turn", turn)

    for name, link in whole.links.items():
        if name != whole.root and link.inertial.mass:
            yield from _warn_of_weight(link)


def _warn_of_wrist(arm: Sequence[RobotJoint]) -> Iterator[str]:
    """Yield a line where the last joint is as strong as a shoulder: files without real limits have one for all."""
    efforts = [j.limits.effort or 0.0 for j in arm if j.kind != "prismatic"]
    wrist = efforts[-1] if arm[-1].kind != "prismatic" else 0.0
    if wrist > STRONG_WRIST and 2 * wrist >= max(efforts):
        yield (
            f"joint {arm[-1].name!r}, a wrist, bears up to {wrist:.3g} N m, as a shoulder does; take the limits from "
            "the arm's data sheet, robot.effort=[...]"
        )


def _warn_of_weight(link: RobotLink) -> Iterator[str]:
    """Yield a line where a link's mass does not go with its size, or its inertia with its mass."""
    where = f"link {link.name!r}"
    mass = link.inertial.mass
    volume = sum(solid_of(shape).volume for shape in link.collisions)
    if volume and not any(find_warning(where, "link mass", mass)):
        yield from find_warning(where, "density", mass / volume)

    gyration = math.sqrt(max(link.inertial.moments) / mass)
    yield from find_warning(where, "gyration", gyration)
