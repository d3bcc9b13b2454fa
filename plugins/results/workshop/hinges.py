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

from core.design import Bearer, Tool
from core.geometry import Array, Pose
from plugins.results.workshop.printing import Check, grown, piece_name
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


def make_hinges(tool: Tool, fit: Fit, printer: Printer) -> Hinges:
    """Make the hinges that can be made; of the other joints a check says what is missing."""
    made = Hinges()
    for joint in tool.bearers:
        missing = "a guide is not part of the solids"
        if joint.joint.kind == "hinge":
            missing = _make_hinge(tool, joint, fit, printer, made)
        if missing:
            made.checks.append(Check(f"joint of {joint.name}", False, missing))
    return made


def _make_hinge(tool: Tool, joint: Bearer, fit: Fit, printer: Printer, made: Hinges) -> str:
    """Add a hinge; return why there is none."""
    pose = tool.placed()[joint.name][1]
    (component,) = (c for c in tool.components if c.name == joint.name)
    axis, at = pose.rotation.apply(joint.joint.axis), (pose @ component.link).position
    links = {name: _link(tool, name) for name in (joint.name, joint.parent)}
    stretches = {name: _on_axis(union(shapes), axis, at) for name, shapes in links.items()}
    tongue, fork = sorted(links, key=lambda name: float(np.ptp(stretches[name])))
    (t0, t1), (f0, f1) = stretches[tongue], stretches[fork]
    cheek = _CHEEK_MM + fit.hinge_mm
    if t1 - t0 < _CHEEK_MM or f0 > t0 - cheek or f1 < t1 + cheek:
        return f"{_NONE}, as on its axis neither link is wider than the other on both sides"
    pins = [length for length in PINS_MM if t1 - t0 + 2 * _CHEEK_MM <= length <= f1 - f0 + 0.1]
    if not pins or f1 - f0 > PINS_MM[-1] + 0.1:
        return f"{_NONE}; it would be {f1 - f0:.0f} mm long"
    sign = -1.0 if fork == joint.name else 1.0  # how the tongue turns as the fork sees it
    swept = _swept(_link(tool, tongue, fit.hinge_mm), at, sign * axis, joint.joint.lower, joint.joint.upper)
    whole = union(links[fork])
    left = whole - union(swept)
    if left.volume() < (1 - LOST) * whole.volume() or len(left.decompose()) > 1:
        return f"{_NONE}: too little is left of {piece_name(fork)} where {piece_name(tongue)} turns"
    radius, bores = fit.axle_mm / 2, []
    for name, solid, (start, end), bore in (
        (tongue, union(links[tongue]), (t0, t1), radius + fit.hinge_mm),
        (fork, left, (f0, t0 - fit.hinge_mm), radius),
        (fork, left, (t1 + fit.hinge_mm, f1), radius),
    ):
        around = (bore + 2 * printer.min_wall_mm) / 1000
        tube = union([rod(at + axis * start / 1000, at + axis * end / 1000, around)])
        if (tube ^ solid).volume() < FULL * tube.volume():
            return f"{_NONE}: {piece_name(name)} is too thin about the axis for one of {fit.axle_mm:g} mm"
        bores.append((name, rod(at + axis * (start - 1) / 1000, at + axis * (end + 1) / 1000, bore / 1000)))
    for name, hole in [*((fork, shape) for shape in swept), *bores]:
        made.cuts.setdefault(name, []).append(hole)
    made.hardware.append(
        f"1 pin {fit.axle_mm:g} m6 x {max(pins)} for the hinge of {joint.name}: "
        f"tight in {piece_name(fork)}, free in {piece_name(tongue)}"
    )
    return ""


def _link(tool: Tool, name: str, by: float = 0.0) -> list[Placed]:
    """The shapes of a link, each side moved out by millimetres."""
    return grown([c for c in tool.components if tool.borne[c.name][0] == name], tool, by)


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
