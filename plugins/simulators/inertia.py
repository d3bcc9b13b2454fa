"""Compute the inertia of bodies, as engines are given it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from core.geometry import Array, Pose, frozen_array
from core.scene import Body, Geom

_ROUNDING_M = 1e-12  # of a centre of mass
ROTOR = 0.001  # a drive's inertia, kg m^2 or kg, for each N m or N that it can do


@dataclass(frozen=True)
class Inertia:
    """How a body or link resists motion, in its principal axes.

    Attributes:
        mass: kg.
        frame: the principal axes at the centre of mass, as a pose in the body's frame.
        moments: about these (3,), kg m^2.
    """

    mass: float
    frame: Pose
    moments: Array


def inertia_of(body: Body) -> Inertia:
    """Compute the inertia of all collision parts of a body together, at one density.

    Its axes are the body's where those are principal; else they are turned.
    """
    return _join_inertias(body.mass, body.collisions)


@lru_cache(maxsize=256)  # scenes have many alike, and a scene is built for each tool
def _join_inertias(mass: float, parts: tuple[Geom, ...]) -> Inertia:
    """Compute the inertia of parts of ``mass`` in all, kg, see `inertia_of`."""
    meshes = []
    for part in parts:
        meshes.append(part.shape.hull().apply_transform(part.pose.matrix))

    density = mass / sum(mesh.volume for mesh in meshes)
    first_moment = sum(mesh.volume * mesh.center_mass for mesh in meshes)
    center = first_moment * density / mass
    center[np.abs(center) < _ROUNDING_M] = 0.0
    tensor = np.zeros((3, 3))
    for mesh in meshes:
        arm = mesh.center_mass - center
        shift = np.dot(arm, arm) * np.eye(3) - np.outer(arm, arm)
        tensor += density * (mesh.moment_inertia + mesh.volume * shift)

    moments = np.diag(tensor)
    if np.abs(tensor - np.diag(moments)).max() < 1e-9 * np.trace(tensor):
        return Inertia(mass, Pose(center), frozen_array(moments))

    return principal(mass, center, tensor)


def principal(mass: float, center: Array, tensor: Array) -> Inertia:
    """Make an inertia.

    Args:
        mass: kg.
        center: (3,) of mass, metres.
        tensor: (3, 3) about it, kg m^2.
    """
    moments, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    frame = Pose.from_rotation(center, Rotation.from_matrix(axes))
    return Inertia(mass, frame, frozen_array(moments))
