"""Check the joints of a tool: their number, ranges, and springs that engines can follow.

An engine's step is 2 to 5 ms. A spring or a damper that acts faster than that shakes or explodes in some engines.
"""

from __future__ import annotations

import math

import numpy as np

from core.design import Bearer, DesignError, Tool
from core.geometry import Array, mass_properties

MAX_JOINTS = 8
MAX_TURN_RAD = 2 * math.pi
MAX_SLIDE_M = 0.5
MIN_MOVED_KG = 0.001
MAX_HZ = 20.0  # of what a spring moves, on its own
MAX_DECAY = 100.0  # 1/s, at which a damper stops what it moves


def check_joints(tool: Tool) -> None:
    """Check the joints of a tool.

    Raises:
        DesignError: the first rule that is broken.
    """
    if len(tool.bearers) > MAX_JOINTS:
        raise DesignError(f"the tool has {len(tool.bearers)} moving joints; at most {MAX_JOINTS} are allowed")
    for bearer in tool.bearers:
        joint, where = bearer.joint, f"the joint of component {bearer.name!r}"
        most, unit = (MAX_TURN_RAD, "rad") if joint.kind == "hinge" else (MAX_SLIDE_M, "m")
        if max(-joint.lower, joint.upper) > most:
            raise DesignError(
                f"{where} goes from {joint.lower:g} to {joint.upper:g} {unit}; at most {most:.3g} is allowed"
            )
        if not -most <= joint.rest <= most:
            raise DesignError(f"{where} has a spring that is relaxed at {joint.rest:g} {unit}; at most {most:.3g}")
        mass, inertia = moved(tool, bearer)
        if mass < MIN_MOVED_KG:
            raise DesignError(f"{where} moves {mass:.2g} kg; at least {MIN_MOVED_KG:g} kg is needed")
        hertz, decay = math.sqrt(joint.stiffness / inertia) / (2 * math.pi), joint.damping / inertia
        if hertz > MAX_HZ:
            raise DesignError(
                f"{where} has too stiff a spring: what it moves would swing at {hertz:.0f} Hz, and at most {MAX_HZ:g} "
                f"can be simulated; a stiffness of {joint.stiffness * (MAX_HZ / hertz) ** 2:.2g} would do, or more mass"
            )
        if decay > MAX_DECAY:
            raise DesignError(
                f"{where} has too much damping: {joint.damping:g} for an inertia of {inertia:.2g}; at most "
                f"{MAX_DECAY * inertia:.2g} can be simulated; for more resistance give friction"
            )


def moved(tool: Tool, bearer: Bearer) -> tuple[float, float]:
    """Compute the mass (kg) that a joint moves, and its inertia: about a hinge's axis (kg m^2), or the mass again."""
    placed, behind = tool.placed(), {bearer.name}
    mass, inertia, axis, origin = 0.0, 0.0, np.zeros(3), np.zeros(3)
    for component in tool.components:
        if component.name not in behind and component.parent not in behind:
            continue
        behind.add(component.name)
        pose = placed[component.name][1]
        turn = pose.rotation.as_matrix()
        if component.name == bearer.name:
            axis, origin = turn @ bearer.joint.axis, pose.apply(bearer.joint.origin)
        center, tensor = mass_properties(component.shape, component.mass)
        away: Array = np.cross(axis, pose.apply(center) - origin)
        mass += component.mass
        inertia += float(axis @ turn @ tensor @ turn.T @ axis + component.mass * (away @ away))
    return mass, inertia if bearer.joint.kind == "hinge" else mass
