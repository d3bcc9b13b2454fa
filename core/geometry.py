"""Poses and shapes as small immutable values.

Lengths are metres, angles radians, quaternions (w, x, y, z). Roll, pitch and yaw are rotations about the fixed x, y and
z axes, in that order, as in URDF: ``R = Rz(yaw) @ Ry(pitch) @ Rx(roll)``.
"""

# ruff: noqa: I001 - names that are handed on (`X as X`) stand together

from __future__ import annotations

from core.shapes.poses import (
    Array as Array,
    Color as Color,
    Pose as Pose,
    Triple as Triple,
    Vector as Vector,
    frozen_array as frozen_array,
    running_sums as running_sums,
    step_lengths as step_lengths,
)
from core.shapes.primitives import (
    Box as Box,
    Capsule as Capsule,
    Cylinder as Cylinder,
    Primitive as Primitive,
    Sphere as Sphere,
)
from core.shapes.solid import (
    Compound as Compound,
    Mesh as Mesh,
    Shape as Shape,
)

KINDS: tuple[type[Primitive], ...] = (Box, Cylinder, Capsule, Sphere)
"""The kinds of shapes that designs and scene files name, in the order in which a model is told of them."""

PRIMITIVES = {kind.kind: kind for kind in KINDS}
"""The same by name."""
