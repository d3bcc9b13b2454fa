"""Make hinges of a tool: the wider of two links becomes a fork about the other one, and a pin goes through both.

Lengths of settings are millimetres, all else metres, in the frame of the mount. Covered by
`tests/plugins/results/workshop/test_hinges.py`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import ToolJoint
from core.geometry import Array, Pose
from plugins.results.workshop.links import ToolLink
from plugins.results.workshop.printing import Check
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.solid import Placed, hull, rod, union

PINS_MM = (8, 10, 12, 16, 20, 24, 30, 40, 50, 60)  # lengths of ISO 8734
LOST = 0.4  # of a fork, at most, where the other link turns
FULL = 0.9  # of a tube around the bore that is solid
_STEP_RAD = 0.08
_FAR_M = 0.5
_CHEEK_MM = 2.0
_NONE = "an axle is not part of the solids"


@dataclass
class Hinges:
    """What is cut out of each link, by what bears it; what was found; and what is bought."""

    cuts: dict[str, list[Placed]] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    hardware: list[str] = field(default_factory=list)


def make_hinges(links: Sequence[ToolLink], fit: Fit, printer: Printer) -> Hinges:
    """Make the hinges that can be made; of the other joints a check says what is missing."""
    made, named = Hinges(), {link.bearer: link for link in links}
    for link in links:
        if link.joint is not None:
            missing = "a guide is not part of the solids"
            if link.joint.kind == "hinge":
                missing = _make_hinge(link, named[link.parent], link.joint, fit, printer, made)
            if missing:
                made.checks.append(Check(f"joint of {link.name}", False, missing))
    return made


def _make_hinge(link: ToolLink, parent: ToolLink, joint: ToolJoint, fit: Fit, printer: Printer, made: Hinges) -> str:
    """Add the hinge of a link on its parent; return why there is none."""
    axis, at = link.frame.rotation.apply(joint.axis), link.frame.position
    stretches = {each: _on_axis(union(each.shapes), axis, at) for each in (link, parent)}
    tongue, fork = sorted(stretches, key=lambda each: float(np.ptp(stretches[each])))
    (t0, t1), (f0, f1) = stretches[tongue], stretches[fork]
    cheek = _CHEEK_MM + fit.hinge_mm
    if t1 - t0 < _CHEEK_MM or f0 > t0 - cheek or f1 < t1 + cheek:
        return f"{_NONE}, as on its axis neither link is wider than the other on both sides"
    pins = [length for length in PINS_MM if t1 - t0 + 2 * _CHEEK_MM <= length <= f1 - f0 + 0.1]
    if not pins or f1 - f0 > PINS_MM[-1] + 0.1:
        return f"{_NONE}; it would be {f1 - f0:.0f} mm long"
    turning = -axis if fork is link else axis  # the tongue's axis as the fork sees it
    swept = _swept(tongue.grown(fit.hinge_mm), at, turning, joint.lower, joint.upper)
    whole = union(fork.shapes)
    left = whole - union(swept)
    if left.volume() < (1 - LOST) * whole.volume() or len(left.decompose()) > 1:
        return f"{_NONE}: too little is left of {fork.name} where {tongue.name} turns"
    radius, bores = fit.axle_mm / 2, []
    for each, solid, (start, end), bore in (
        (tongue, union(tongue.shapes), (t0, t1), radius + fit.hinge_mm),
        (fork, left, (f0, t0 - fit.hinge_mm), radius),
        (fork, left, (t1 + fit.hinge_mm, f1), radius),
    ):
        around = (bore + 2 * printer.min_wall_mm) / 1000
        tube = union([rod(at + axis * start / 1000, at + axis * end / 1000, around)])
        if (tube ^ solid).volume() < FULL * tube.volume():
            return f"{_NONE}: {each.name} is too thin about the axis for one of {fit.axle_mm:g} mm"
        bores.append((each, rod(at + axis * (start - 1) / 1000, at + axis * (end + 1) / 1000, bore / 1000)))
    for each, hole in [*((fork, shape) for shape in swept), *bores]:
        made.cuts.setdefault(each.bearer, []).append(hole)
    fits = f"tight in {fork.name}, free in {tongue.name}"
    made.hardware.append(f"1 pin {fit.axle_mm:g} m6 x {max(pins)} for the hinge of {link.name}: {fits}")
    return ""


def _swept(shapes: Sequence[Placed], at: Array, axis: Array, lower: float, upper: float) -> tuple[Placed, ...]:
    """What shapes sweep as they turn about an axis between two angles: hulls of two positions next to each other."""
    angles = np.linspace(lower, upper, 2 + int((upper - lower) / _STEP_RAD))
    turns = [Rotation.from_rotvec(angle * axis).as_matrix() for angle in angles]
    solids = [pose.apply(part.to_trimesh().vertices) for shape, pose in shapes for part in shape.convex_parts()]
    pairs = [[(points - at) @ turn.T + at for turn in two] for points in solids for two in itertools.pairwise(turns)]
    return tuple((hull(np.vstack(two)), Pose()) for two in pairs)


def _on_axis(link: Any, axis: Array, at: Array) -> tuple[float, float]:
    """Where a link lies on a line: from and to, in millimetres from ``at``; the stretch nearest to it."""
    first, last = 1000 * (at - _FAR_M * axis), 1000 * (at + _FAR_M * axis)
    hits = [float((np.asarray(hit.position) - 1000 * at) @ axis) for hit in link.ray_cast(first, last)]
    ends = list(zip(hits[::2], hits[1::2], strict=False))  # in and out
    return min(ends, key=lambda of: max(of[0], -of[1], 0.0), default=(0.0, 0.0))
