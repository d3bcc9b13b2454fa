"""Solids for shading: sharp edges stay sharp, round faces round."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import trimesh

from core.design import Component
from core.scene import Color

_SHARP_RAD = np.radians(30.0)  # faces that meet at a wider angle are shaded apart


def shaded(solid: trimesh.Trimesh, color: Color) -> trimesh.Trimesh:
    """The solid with a normal and a colour at each vertex."""
    mesh = trimesh.graph.smooth_shade(solid, angle=_SHARP_RAD)
    mesh.visual.vertex_colors = np.clip(color, 0.0, 1.0)
    return mesh


def joined(solids: Iterable[tuple[Component, trimesh.Trimesh]]) -> trimesh.Trimesh:
    """Components as one mesh, in their colours."""
    return trimesh.util.concatenate([shaded(solid, component.color) for component, solid in solids])
