"""Read a tool's files back, and play the motion with what is in them, so that it is known what is printed.

Engines collide convex shapes. So the parts of a link are put together again, and what its solid shares with each
convex shape that was simulated becomes a hull. What is in no shape, such as a boss, is a hull too, if it is nearly
convex. What hulls fill and what they leave out is measured. Masses and inertias are those of the components: a slicer
decides on them, not an STL file. Covered by `tests/plugins/results/workshop/test_readback.py`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from core.design import Tool
from core.errors import UserError
from core.geometry import Array, Compound, Mesh, Pose
from core.robot.meshes import farthest
from core.robot.solids import farthest_from_surface
from core.values.shapes import resized
from plugins.results.workshop.printing import Check, piece_name
from plugins.results.workshop.solid import hull, manifold, to_mesh, union
from plugins.results.workshop.tool import EXACT_MM, SAME_REWARD, PrintedTool

MISSED_MM = 4.0  # of the files, at most: the edges of a sleeve
NEARLY = 0.8  # of its hull's volume: such a piece is taken to be convex
_LEAST_MM3, _THIN_MM = 1.0, 1.0
_POINTS = 5000  # at which a distance is measured


def read_back(made: PrintedTool, folder: Path) -> tuple[Tool, float, float]:
    """Return the mounted tool with collision shapes from its STL files.

    Returns:
        The tool, and by how many millimetres at most its shapes stick out of the files' solids, and these out of them.

    Raises:
        UserError: a file can't be read, or a component is not in the files.
    """
    tool, solids = made.mounted, _solids(folder)
    welds = {part.link: part.weld_mm for part in made.parts}
    hulls: dict[str, list[Array]] = {}
    shapes: dict[str, list[Mesh]] = {}
    for component in tool.components:
        of, pose = piece_name(tool.borne[component.name][0]), tool.placed()[component.name][1]
        wide = [resized(c, c.bounds[1] + 0.002 * (welds[of] + EXACT_MM)) for c in component.shape.convex_parts()]
        found = [_corners(piece) for each in wide for piece in _pieces(solids[of] ^ union([(each, pose)]))]
        if not found:
            raise UserError(f"component {component.name} is not in the files of {folder}; write them again")
        hulls.setdefault(of, []).extend(found)
        shapes[component.name] = [_mesh(points, pose) for points in found]
    filled, missed = [], []
    for of, solid in solids.items():
        first = next(c.name for c in tool.components if piece_name(tool.borne[c.name][0]) == of)
        rest = [piece for piece in _pieces(solid - _hulls(hulls[of])) if _is_solid(piece)]
        hulls[of] += [_corners(piece) for piece in rest]
        shapes[first] += [_mesh(_corners(piece), tool.placed()[first][1]) for piece in rest]
        filled.append(_beyond(_hulls(hulls[of]), solid))
        missed.append(_beyond(solid, _hulls(hulls[of])))
    read = [
        replace(c, shape=Compound(Mesh.from_trimesh(c.shape.to_trimesh()), tuple(shapes[c.name])))
        for c in tool.components
    ]
    return replace(tool, components=tuple(read)), max(filled), max(missed)


def check_files(
    made: PrintedTool, folder: Path, simulated: Mapping[str, float], earned: Callable[[str, Tool], float]
) -> tuple[Check, dict[str, float]]:
    """Compare what a tool earns by its files with what was ``simulated``, by engine; return that, too.

    ``earned`` plays the motion in an engine with a tool, and returns the reward.
    """
    name, read = "files read back", dict[str, float]()
    try:
        tool, filled, missed = read_back(made, folder)
        for engine in simulated:
            read[engine] = earned(engine, tool)
    except UserError as error:
        return Check(name, False, str(error)), read
    rows = [f"{reward:.3f} for {simulated[engine]:.3f} in {engine}" for engine, reward in read.items()]
    same = all(abs(reward - simulated[engine]) <= SAME_REWARD for engine, reward in read.items())
    shapes = f"shapes stick out by {filled:.1f} mm, as they fill bores and slots, and miss {missed:.1f} mm"
    return Check(name, same and missed <= MISSED_MM, f"it earns {', '.join(rows)}; {shapes}"), read


def _solids(folder: Path) -> dict[str, Any]:
    """The solid of each link as its files have it, in the frame of its mount, millimetres."""
    import trimesh

    found = dict[str, Any]()
    for part in json.loads((folder / "print.json").read_text())["parts"]:
        mesh = trimesh.load_mesh(folder / part["file"])
        solid = manifold(mesh.apply_transform(np.array(part["to_mount"])))
        if solid.is_empty():
            raise UserError(f"{folder / part['file']} is not a closed solid as it is read back; write it again")
        found[part["of"]] = found[part["of"]] + solid if part["of"] in found else solid
    return found


def _pieces(solid: Any) -> list[Any]:
    return [piece for piece in solid.decompose() if piece.volume() > _LEAST_MM3]


def _is_solid(piece: Any) -> bool:
    """Whether a piece is nearly convex, and thicker than what hulls of few corners leave of round shapes."""
    nearly = piece.volume() > NEARLY * piece.hull().volume()
    return bool(nearly and 2 * piece.volume() > _THIN_MM * piece.surface_area())


def _corners(piece: Any) -> Array:
    """The corners of a piece's hull, in metres."""
    return farthest(to_mesh(piece.hull()).vertices / 1000)


def _mesh(points: Array, pose: Pose) -> Mesh:
    return hull(pose.inverse().apply(points))


def _hulls(corners: list[Array]) -> Any:
    return union([(hull(points), Pose()) for points in corners])


def _beyond(one: Any, other: Any) -> float:
    """How far a solid gets beyond another one, in millimetres; by points, so that it may be a little more."""
    import trimesh

    pieces, surface = _pieces(one - other), to_mesh(other)
    if not pieces:
        return 0.0
    rest = trimesh.util.concatenate([to_mesh(piece) for piece in pieces])
    rng, sizes = np.random.default_rng(0), np.sqrt(rest.area_faces)  # what is small counts more than by its area
    chosen = rest.triangles[rng.choice(len(sizes), _POINTS, p=sizes / sizes.sum())]
    points = np.einsum("pkx,pk->px", chosen, rng.dirichlet((1, 1, 1), _POINTS))
    return farthest_from_surface(points, surface.vertices, surface.faces)
