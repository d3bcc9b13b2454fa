"""Make a tool's printed parts: solids that fit the arm and the printer, their files, and what speaks against them."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from core.config.settings import Fit, Printer
from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Compound
from core.interfaces import Material
from core.solids.held import solids
from core.support.cli import write_bytes
from core.values.robots import Robot
from plugins.results.workshop.cutting import Joint, cut
from plugins.results.workshop.hinges import make_hinges
from plugins.results.workshop.mounting import Mount, at_flange, on_finger, weighed
from plugins.results.workshop.printing import (
    LAYER_S,
    WELDS_MM,
    Check,
    Piece,
    checked,
    estimate,
    grown,
    joined,
    piece_name,
    to_3mf,
)
from plugins.results.workshop.solid import Solid, Step, body, to_mesh, union
from plugins.results.workshop.step import NO_STEP, can_write_step, write_step
from plugins.results.workshop.verdicts import printable

EXACT_MM = 0.1  # by which the solid may differ from what was simulated
SAME_REWARD = 0.02
SAME_WEIGHT = 0.2
_NOTHING_MM3 = 1.0


@dataclass(frozen=True, eq=False)
class Part:
    """A printed part: its solid in the frame of its mount, how it lies on the plate, and by how much it was grown."""

    of: str
    solid: Solid
    piece: Piece
    weld_mm: float


@dataclass(frozen=True, eq=False)
class PrintedTool:
    """A tool as parts; ``mounted``: the tool with its plate or sleeves as components, as it can be simulated.

    ``step`` says whether there is a STEP file.
    """

    parts: tuple[Part, ...]
    checks: tuple[Check, ...]
    joints: tuple[Joint, ...]
    hardware: tuple[str, ...]
    mounted: Tool
    material: Material
    printer: Printer
    step: bool = False

    @property
    def notes(self) -> list[str]:
        """What is not written, and how to get it."""
        return [] if not self.parts or can_write_step() else [NO_STEP]

    @property
    def faults(self) -> list[str]:
        """What speaks against it, and what to change, a line each."""
        found = printable([part.piece for part in self.parts], self.checks)
        return [str(verdict) for verdict in found if verdict.passed is False]

    def figures(self) -> dict[str, Any]:
        """Return all figures as data."""
        parts = [part_figures(part, self.material, self.printer) for part in self.parts]
        total = {name: round(math.fsum(part[name] for part in parts), 3) for name in ("mass_g", "volume_cm3", "hours")}
        return {
            "printer": vars(self.printer),
            "material": self.material.name if self.material.density_kg_m3 else "pla, solid",
            "estimate": f"hours, roughly: plastic at flow_mm3_s, and {LAYER_S:g} s a layer; no supports",
            "total": total,
            "parts": [{"file": self.file(n)} | part for n, part in enumerate(parts)],
            "joints": [str(joint) for joint in self.joints],
            "hardware": list(self.hardware),
            "step": "tool.step" if self.step else None,
            "checks": _as_data(self.checks),
        }

    def file(self, number: int) -> str:
        return f"part_{number + 1}_of_{len(self.parts)}.stl"


def part_figures(part: Part, material: Material, printer: Printer) -> dict[str, Any]:
    """Measure a part; ``to_mount`` (4, 4) leads from its file to the frame of its mount, millimetres."""
    import trimesh

    mesh = part.piece.mesh
    own = to_mesh(body(part.solid))
    back = trimesh.transformations.superimposition_matrix(mesh.vertices.T, own.vertices.T)
    return {
        "of": part.of,
        "size_mm": np.round(mesh.extents, 2).tolist(),
        "volume_cm3": round(part.piece.volume_cm3, 3),
        **{name: round(value, 4) for name, value in estimate(part.piece, material, printer).items()},
        "to_mount": np.round(back, 6).tolist(),
        "checks": _as_data(part.piece.checks),
    }


def _as_data(checks: Sequence[Check]) -> dict[str, Any]:
    return {check.name: {"passed": check.passed, "found": check.found} for check in checks}


def make_tool(tool: Tool, robot: Robot, material: Material, printer: Printer, fit: Fit) -> PrintedTool:
    """Turn a tool into parts that a printer makes; the bare hand has none.

    Raises:
        UserError: the robot's flange can't be fitted.
    """
    parts, checks, joints, hardware = list[Part](), list[Check](), list[Joint](), list[str]()
    added, wholes, hinges = list[Component](), dict[str, Any](), make_hinges(tool, fit, printer)
    for bearer, placed in solids(tool, loose=True).items():
        components, name = [component for component, _ in placed], piece_name(bearer)
        solid, mount, weld = _mounted(tool, robot, bearer, components, fit, hinges.steps.get(bearer, ()))
        wholes[bearer] = whole = body(solid)
        added += weighed(mount, grown(components, tool, 0), material)
        adding = [shape for step in mount.steps if step.kind == "add" for shape in step.shapes]
        fitted = [Component(f"mount {n}", bearer, pose, shape) for n, (shape, pose) in enumerate(adding)]
        every = replace(tool, components=(*tool.components, *fitted))
        piece = joined([*components, *fitted], every, weld, printer)
        if len(whole.decompose()) > 1:
            piece = Check(piece.name, False, f"it falls into {len(whole.decompose())} pieces")
        axes = np.vstack([tool.placed()[c.name][1].rotation.as_matrix().T for c in components])
        corners = to_mesh(union(adding)).vertices if adding else np.zeros((0, 3))
        cuts, own = cut(solid, printer, fit, axes, corners)
        bodies = [body(part) for part in cuts]
        checks += [*mount.checks, *(_faithful(components, tool, mount, weld, whole, bodies))]
        checks += [Check(f"joint {n}", joint.tails > 0, str(joint)) for n, joint in enumerate(own, len(joints) + 1)]
        for one, found in zip(cuts, bodies, strict=True):
            single = piece if len(cuts) == 1 else _single(found)
            parts.append(
                Part(name, one, checked(f"part_{len(parts) + 1}", to_mesh(found), printer, weld, single), weld)
            )
        joints += own
        hardware += mount.hardware
    checks += [*_apart(tool, wholes), *hinges.checks]
    hardware += hinges.hardware
    mounted = replace(tool, components=(*tool.components, *added))
    if parts:
        checks.append(_weight(mounted, parts, material, printer))
    return PrintedTool(tuple(parts), tuple(checks), tuple(joints), tuple(hardware), mounted, material, printer)


def _weight(mounted: Tool, parts: Sequence[Part], material: Material, printer: Printer) -> Check:
    printed = math.fsum(estimate(part.piece, material, printer)["mass_g"] for part in parts)
    simulated = 1000 * mounted.mass
    said = f"printed it weighs {printed:.0f} g, in simulation {simulated:.0f} g"
    return Check("weight", abs(printed - simulated) <= SAME_WEIGHT * printed, said)


def _single(found: Any) -> Check:
    count = len(found.decompose())
    return Check("one piece", count == 1, "one body" if count == 1 else f"it falls into {count} pieces")


def _mounted(
    tool: Tool, robot: Robot, bearer: str, components: Sequence[Component], fit: Fit, hinges: Sequence[Step]
) -> tuple[Solid, Mount, float]:
    """Weld components by as little as makes them and their mount one body; then cut ``hinges``."""
    for weld in WELDS_MM:
        shapes, mount = tuple(grown(components, tool, weld)), Mount()
        if bearer == RIGID_MOUNT:
            mount = at_flange(robot, tool, components, shapes, fit)
        elif bearer in GRIPPER_MOUNTS:
            mount = on_finger(robot, tool, bearer, shapes, fit)
        mount = replace(mount, steps=(*mount.steps, *hinges))
        solid = (Step("add", shapes), *mount.steps)
        if len(body(solid).decompose()) == 1:
            break
    return solid, mount, weld


def _faithful(
    components: Sequence[Component], tool: Tool, mount: Mount, weld: float, whole: Any, parts: Sequence[Any]
) -> list[Check]:
    """Compare the solid with the components that were simulated, apart from what fits it to the arm."""
    more = [shape for step in mount.steps if step.kind == "add" for shape in step.shapes]
    less = [shape for step in mount.steps if step.kind == "cut" for shape in step.shapes]
    wide, narrow = (_added([_offset(c, tool, by) for c in components]) for by in (weld + EXACT_MM, -weld - EXACT_MM))
    excess = max(0.0, (whole - wide - union(more)).volume() if more else (whole - wide).volume())
    lack = max(0.0, (narrow - union(less) - whole).volume() if less else (narrow - whole).volume())
    here = f"{excess:.1f} mm³ too much and {lack:.1f} too little, {weld + EXACT_MM:g} mm off what was simulated"
    found = [Check("as simulated", excess < _NOTHING_MM3 and lack < _NOTHING_MM3, here)]
    if len(parts) > 1:
        together = _added(parts)
        over, gaps = (together - whole).volume(), (whole - together).volume()
        rest = f"{over:.1f} mm³ too much; gaps of {gaps / whole.volume():.2%} of it"
        found.append(Check("put together", over < _NOTHING_MM3 and gaps < 0.03 * whole.volume(), rest))
    return found


def _added(solids: Sequence[Any]) -> Any:
    return sum(solids[1:], solids[0])


def _offset(component: Component, tool: Tool, by: float) -> Any:
    """Move the sides of a component out, or in: of one that is not convex by Minkowski's sum with a cube."""
    import manifold3d

    if not isinstance(component.shape, Compound):
        return union(grown([component], tool, by))
    exact, cube = union(grown([component], tool, 0)), manifold3d.Manifold.cube((2 * abs(by),) * 3, True)
    return exact.minkowski_sum(cube) if by > 0 else exact.minkowski_difference(cube)


def _apart(tool: Tool, wholes: dict[str, Any]) -> list[Check]:
    """Check that bodies that joints part do not share space at rest."""
    found, mounts = [], {c.name: mount for c, (mount, _) in zip(tool.components, tool.placed().values(), strict=True)}
    for a, b in itertools.combinations(wholes, 2):
        if mounts.get(a, a) == mounts.get(b, b):
            shared = (wholes[a] ^ wholes[b]).volume()
            said = f"{piece_name(a)} and {piece_name(b)} share {shared / 1000:.2f} cm³ at rest"
            if shared >= _NOTHING_MM3:
                found.append(Check("apart", False, said))
    return found


def write_tool(made: PrintedTool, folder: Path) -> PrintedTool:
    """Write STL, 3MF, STEP if it can be, and lists (`write_lists`); add a check for what is not in the STEP file.

    Raises:
        UserError: a file can't be written.
    """
    if not made.parts:
        return made
    for old in folder.glob("part_*_of_*.stl"):  # of an export before, which may have had more parts
        old.unlink()
    for number, part in enumerate(made.parts):
        data = part.piece.mesh.export(file_type="stl")
        assert isinstance(data, bytes)
        write_bytes(folder / made.file(number), data)
    write_bytes(folder / "tool.3mf", to_3mf([part.piece for part in made.parts]))
    (folder / "tool.step").unlink(missing_ok=True)
    parts = [(made.file(number), part.solid) for number, part in enumerate(made.parts)]
    missing = [Check("STEP", False, f"{name} can't be modelled") for name in write_step(parts, folder / "tool.step")]
    made = replace(made, checks=(*missing, *made.checks), step=can_write_step() and len(missing) < len(parts))
    write_lists(made, folder)
    return made


def write_lists(made: PrintedTool, folder: Path) -> None:
    """Write ``print.json`` and ``assembly.md``.

    Raises:
        UserError: a file can't be written.
    """
    figures = made.figures()
    write_bytes(folder / "print.json", (json.dumps(figures, indent=2) + "\n").encode())
    write_bytes(folder / "assembly.md", assembly(made, figures).encode())


def assembly(made: PrintedTool, figures: dict[str, Any]) -> str:
    """List the parts, what joins them, what is bought, and what speaks against it."""
    rows = [
        f"| `{part['file']}` | {part['of']} | {' x '.join(f'{side:.0f}' for side in part['size_mm'])} mm | "
        f"{part['mass_g']:.0f} g | {part['hours']:.1f} h |"
        for part in figures["parts"]
    ]
    lines = [
        "# Assembly",
        "",
        "| file | of | size as it lies | mass | time, estimated |",
        "|---|---|---|---|---|",
        *rows,
    ]
    lines += [
        "",
        "Parts of one piece follow each other: slide tails into their sockets to the floor, with glue.",
    ] * bool(made.joints)
    lines += ["", *(f"- {item}" for item in made.hardware)] if made.hardware else []
    lines += ["", "What speaks against it:", "", *(f"- {fault}" for fault in made.faults)] if made.faults else []
    return "\n".join(lines) + "\n"
