"""Build a body as a scene file describes it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count, islice

import numpy as np
import trimesh

from core.geometry import Array, Box, Mesh, Pose, Shape
from core.scene import Body, Color, Filling, Geom, Soft, floor
from core.solids.standing import bound
from plugins.tasks.file.imports.imported import HEAVIEST, LIGHTEST
from plugins.tasks.file.named_files import Files
from plugins.tasks.file.spec import (
    BodySpec,
    ImportSpec,
    MarkSpec,
    RepeatSpec,
    SceneSpec,
    ShapeSpec,
    rgba,
)
from plugins.tasks.file.vessels import HANDLE_M, shape_vessel

GREY = "#b3b3b3"
THICK_M = 0.05  # of a wall around the ground
SEEN_THROUGH = 0.3  # the opacity of a mark with a shape
APART = 1.01  # times their size: how far repeated bodies are from each other


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


def build_mark(spec: MarkSpec) -> Body:
    """Build a mark, in the frame that it is placed in: drawn through where it has a shape."""
    color = rgba(spec.color)
    if spec.primitive is None:
        return Body.mark(spec.name, spec.position, spec.radius, color)

    drawn = Geom(spec.primitive, color=(*color[:3], SEEN_THROUGH))
    return Body(spec.name, read_pose(spec), 0.0, (drawn,), ())


def build_ground(spec: SceneSpec) -> Iterator[Body]:
    """Yield the ground that a file wants, and the wall around it."""
    if not spec.floor:
        return

    ground = spec.ground
    slab = floor(spec.floor_height, ground.friction)
    if ground.size is None:
        yield slab
        return

    size = (*ground.size, 0.1)
    (drawn,) = slab.visuals
    part = replace(drawn, shape=Box(size))
    yield replace(slab, visuals=(part,), collisions=(part,))
    if ground.wall is None:
        return

    walls = []
    for axis, sign in np.ndindex(2, 2):
        sides = np.array([*ground.size, ground.wall])
        sides[axis] = THICK_M
        place = np.array([0.0, 0.0, spec.floor_height + ground.wall / 2])
        place[axis] = (2 * sign - 1) * (ground.size[axis] + THICK_M) / 2
        walls.append(Geom(Box(tuple(sides)), Pose(place), drawn.color))

    yield Body("wall", Pose(), 0.0, tuple(walls), tuple(walls), ground.friction)


def place_copies(repeat: RepeatSpec, body: Body) -> Iterator[Pose]:
    """Yield where the frames of equal bodies are, in the frame of the first."""
    low, high = bound(replace(body, pose=Pose()))
    spacing = np.broadcast_to(repeat.spacing or APART * (high - low), 3)

    if repeat.grid:
        for number in np.ndindex(*repeat.grid[::-1]):
            yield Pose(spacing * number[::-1])

        return

    radius = repeat.radius or 0.0
    if repeat.ring:
        for angle in np.arange(repeat.ring) * 2 * np.pi / repeat.ring:
            place = (radius * np.cos(angle), radius * np.sin(angle), 0.0)
            yield Pose.xyz_rpy(place, (0.0, 0.0, angle))

        return

    layers = (_fill_layer(radius, spacing, layer) for layer in count())
    places = chain.from_iterable(layers)
    yield from islice(places, repeat.heap)


def _fill_layer(radius: float, spacing: Array, layer: int) -> Iterator[Pose]:
    """Yield places in rows within a radius, a layer shifted against the one below it."""
    most = int(radius // spacing[:2].min()) + 1
    shift = spacing * (layer % 2) / 2
    for row in range(-most, most + 1):
        for column in range(-most, most + 1):
            place = spacing * (column, row, layer) + shift * (1, 1, 0)
            if np.hypot(*place[:2]) <= radius or (row, column) == (0, 0):
                yield Pose(place)


def read_pose(spec: ShapeSpec | ImportSpec | MarkSpec) -> Pose:
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
        if spec.color is not None:
            visuals = tuple(replace(geom, color=color) for geom in visuals)
    else:
        visuals = tuple(
            geom for part in spec.parts or () for geom in _geoms(part, color)
        )
        if spec.parts is None:
            visuals = tuple(Geom(*placed, color) for placed in _shapes(spec))

        collisions = visuals

    mass = spec.mass or 0.0
    if spec.density is not None:
        mass = spec.density * _measure_volume(spec, files, visuals)

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
        breaks_n=spec.breaks_n or 0.0,
        smooth=spec.smooth,
        magnetic=spec.magnetic,
        loops=spec.loops,
    )


def _measure_volume(spec: BodySpec, files: Files, shapes: Sequence[Geom]) -> float:
    """Measure the volume of a body, m^3; only a density needs it, and that of many walls takes long."""
    if spec.file is None:
        return sum(geom.shape.volume for geom in shapes)

    (read,) = files.mesh(spec.file, spec.scale).bodies
    return read.mass


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
    cup = spec.cup or spec.mug or spec.bottle
    if spec.tube is not None:
        yield from shape_vessel(spec.tube)
    elif cup is not None:
        cup = replace(cup, floor=cup.floor or cup.wall)
        if spec.mug is not None:
            cup = replace(cup, handle=cup.handle or HANDLE_M)

        yield from shape_vessel(cup)
    elif spec.primitive is not None:
        yield spec.primitive, Pose()
