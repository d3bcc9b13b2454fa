"""Build a body as a scene file describes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from core.geometry import Box, Mesh, Pose, Shape
from core.scene import Body, Color, Filling, Geom, Soft
from plugins.tasks.file.files import Files
from plugins.tasks.file.imports.bodies import HEAVIEST, LIGHTEST
from plugins.tasks.file.spec import BodySpec, ImportSpec, ShapeSpec, rgba

GREY = "#b3b3b3"


def build_body(spec: BodySpec, files: Files) -> Body:
    """Build a body, in the frame that it is placed in.

    Raises:
        UserError: its file can't be used.
        ValueError: it would be too light or too heavy.
    """
    body = _build(spec, files)
    if not spec.fixed and not LIGHTEST <= body.mass <= HEAVIEST:
        limits = f"{LIGHTEST:g} to {HEAVIEST:g}; change its density"
        raise ValueError(f"its mass would be {body.mass:.3g} kg, beyond {limits}")
    return body


def read_pose(spec: ShapeSpec | ImportSpec) -> Pose:
    """Read a position and angles."""
    roll, pitch, yaw = np.radians(spec.rpy_deg)
    return Pose.xyz_rpy(spec.position, (roll, pitch, yaw))


def _build(spec: BodySpec, files: Files) -> Body:
    """Build a body, whatever its mass is."""
    color = rgba(spec.color or GREY)
    pose = read_pose(spec)
    if spec.elastic is not None:
        form = spec.rope or spec.cloth or Filling(_hull(spec, files), spec.counts)
        return Soft.make(
            spec.name, form, spec.elastic, pose, color=color, pinned=spec.pinned
        )

    if spec.file is not None:
        (read,) = files.mesh(spec.file, spec.scale).bodies
        visuals = read.visuals
        collisions = read.collisions
        volume = read.mass
        if spec.color is not None:
            visuals = tuple(replace(geom, color=color) for geom in visuals)
    else:
        visuals = tuple(_geom(part, color) for part in spec.parts or ())
        if spec.parts is None:
            visuals = (Geom(_shape(spec), color=color),)
        collisions = visuals
        volume = sum(geom.shape.volume for geom in visuals)

    mass = spec.mass or 0.0
    if spec.density is not None:
        mass = spec.density * volume
    return Body(
        spec.name,
        pose,
        mass,
        visuals,
        collisions,
        friction=spec.friction,
        rolling_friction=spec.rolling_friction,
        restitution=spec.restitution,
        velocity=spec.velocity,
        spin=spec.spin,
    )


def _geom(part: ShapeSpec, color: Color) -> Geom:
    """Build one of a body's parts, of the body's colour if it has none."""
    if part.color:
        color = rgba(part.color)
    return Geom(_shape(part), read_pose(part), color)


def _hull(spec: BodySpec, files: Files) -> Shape:
    """Return a shape whose convex hull is that of a body's one shape, or of its file."""
    if spec.file is None:
        return _shape(spec)
    (read,) = files.mesh(spec.file, spec.scale).bodies
    parts = [part.shape.to_trimesh() for part in read.collisions]
    return Mesh.from_trimesh(trimesh.util.concatenate(parts).convex_hull)


def _shape(spec: ShapeSpec) -> Shape:
    """Return the one shape that is given."""
    shape = spec.sphere or spec.cylinder or spec.capsule
    if shape is not None:
        return shape
    assert spec.box is not None  # the spec has one of them
    return Box(spec.box)
