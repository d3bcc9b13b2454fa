"""Build a body as a scene file describes it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import trimesh

from core.geometry import Box, Mesh, Pose, Shape
from core.scene import Body, Color, Filling, Geom, Soft
from plugins.tasks.file.files import Files
from plugins.tasks.file.imports.bodies import HEAVIEST, LIGHTEST
from plugins.tasks.file.spec import BodySpec, ImportSpec, ShapeSpec, rgba
from plugins.tasks.file.vessels import HANDLE_M

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
        visuals = tuple(
            geom for part in spec.parts or () for geom in _geoms(part, color)
        )
        if spec.parts is None:
            visuals = tuple(Geom(*placed, color) for placed in _shapes(spec))
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


def _geoms(part: ShapeSpec, color: Color) -> Iterator[Geom]:
    """Yield the shapes of one of a body's parts, of the body's colour if it has none."""
    if part.color:
        color = rgba(part.color)
    place = read_pose(part)
    for shape, pose in _shapes(part):
        within = place
        if pose != Pose():
            within = place @ pose
        yield Geom(shape, within, color)


def _hull(spec: BodySpec, files: Files) -> Shape:
    """Return a shape whose convex hull is that of a body's one shape, or of its file."""
    shapes = list(_shapes(spec))
    if spec.file is not None:
        (read,) = files.mesh(spec.file, spec.scale).bodies
        shapes = [(part.shape, part.pose) for part in read.collisions]
    elif len(shapes) == 1:
        return shapes[0][0]
    solids = [shape.to_trimesh().apply_transform(pose.matrix) for shape, pose in shapes]
    return Mesh.from_trimesh(trimesh.util.concatenate(solids).convex_hull)


def _shapes(spec: ShapeSpec) -> Iterator[tuple[Shape, Pose]]:
    """Yield the convex shapes of the one shape that is given, with their poses in its frame."""
    cup = spec.cup or spec.mug
    if spec.tube is not None:
        yield from spec.tube.parts()
    elif cup is not None:
        cup = replace(cup, floor=cup.floor or cup.wall)
        if spec.mug is not None:
            cup = replace(cup, handle=cup.handle or HANDLE_M)
        yield from cup.parts()
    elif spec.box is not None:
        yield Box(spec.box), Pose()
    else:
        shape = spec.sphere or spec.cylinder or spec.capsule
        if shape is not None:
            yield shape, Pose()
