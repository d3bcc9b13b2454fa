"""Estimate what loads that act at once do to a tool, its components taken as beams (`core.designs.stiffness`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from core.design import Tool
from core.designs.stiffness import POINT_M, Beam, Beams
from core.geometry import Array
from core.values.materials import Material


class Load(NamedTuple):
    """A ``force`` (3,), newtons, at a ``point`` (3,) of a component, in the frame of its mount; ``what`` names it."""

    what: str
    component: str
    point: Array
    force: Array


class Stressed(NamedTuple):
    """What loads do to a component: the largest stress, pascals, and of what adds most to it: ``what`` it is, its
    ``newtons``, its lever ``lever_m``, and ``bend_m``, by how much it would move its own place, across and alone.
    """

    stress_pa: float
    what: str
    newtons: float
    lever_m: float
    bend_m: float


def stresses(tool: Tool, joints: Mapping[str, Array], material: Material, loads: Sequence[Load]) -> dict[str, Stressed]:
    """Estimate what loads that act at once do to each component that carries one.

    ``joints`` holds for each component the point (3,) where it touches its parent. The moments of all loads beyond a
    section add up as vectors, so that loads that oppose each other do so here. Sections are looked at where a
    component is held, and where a load acts on it or comes from what it carries.
    """
    beams = Beams(tool, joints, material)
    carried: dict[str, list[tuple[Load, Beam]]] = {}
    for load in loads:
        for carrier, beam in [*beams.chains[load.component], (load.component, beams.beam(load.component, load.point))]:
            carried.setdefault(carrier, []).append((load, beam))
    stressed = {}
    for carrier, borne in carried.items():
        stress, place, beyond = _weakest(borne)
        groups: dict[str, list[Load]] = {}
        for load in beyond:
            groups.setdefault(load.what, []).append(load)
        what = max(groups, key=lambda name: np.linalg.norm(_moment(groups[name], place)), default="")
        if what:
            newtons = float(np.linalg.norm(sum(load.force for load in groups[what])))
            hardest = max(groups[what], key=lambda load: np.linalg.norm(load.force))
            bend, _ = beams.bend(hardest.component, hardest.point)
            lever = float(np.linalg.norm(hardest.point - place))
            stressed[carrier] = Stressed(stress, what, newtons, lever, newtons * bend)
    return stressed


def _weakest(carried: Sequence[tuple[Load, Beam]]) -> tuple[float, Array, list[Load]]:
    """Find the section of a component that bears most: its stress, its place (3,), and the loads beyond it."""
    loads = [load for load, _ in carried]
    starts, stops, _, weak = map(np.array, zip(*(beam for _, beam in carried), strict=True))
    forces, points = (np.array([load[k] for load in loads]) for k in (3, 2))
    ways = stops - starts
    along = ways @ ways.T  # (N, N): how far each gets along the way of another, times its length
    lengths = np.maximum(np.sqrt(np.diagonal(along)), POINT_M)
    turning = np.cross(points, forces)
    best: tuple[float, Array, Array] = (-1.0, starts[0], np.zeros(len(loads), dtype=bool))
    for sections, beyond in (
        (starts, along / lengths[:, None] > POINT_M),
        (stops, along / lengths[:, None] >= lengths[:, None] - POINT_M),
    ):
        moments = beyond @ turning - np.cross(sections, beyond @ forces)
        stress = weak * np.linalg.norm(moments, axis=1)
        k = int(stress.argmax())
        if stress[k] > best[0]:
            best = float(stress[k]), sections[k], beyond[k]
    return best[0], best[1], [load for load, counts in zip(loads, best[2], strict=True) if counts]


def _moment(loads: Sequence[Load], place: Array) -> Array:
    moments: Array = np.sum([np.cross(load.point - place, load.force) for load in loads], axis=0)
    return moments
