"""Make a tool's printed parts: solids that fit the arm and the printer, their files, and what speaks against them."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Array, Compound
from core.support.cli import write_bytes
from core.values.materials import PAPER, Material
from core.values.robots import Robot
from plugins.results.workshop.cutting import Dovetails, cut
from plugins.results.workshop.hinges import make_hinges
from plugins.results.workshop.mounting import CORE_MM, Mount, at_flange, on_finger, weighed
from plugins.results.workshop.printing import (
    WELDS_MM,
    Check,
    PrintedPart,
    grown,
    joined,
    piece_name,
    print_part,
    to_3mf,
    to_stl,
    widened,
)
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.solid import Placed, Workpiece, closed, manifold, to_mesh, union
from plugins.results.workshop.step import NO_STEP, can_write_step, write_step
from plugins.results.workshop.texts import filled
from plugins.results.workshop.verdicts import printable

EXACT_MM = 0.1  # by which the solid may differ from what was simulated
SAME_FILE = 0.001  # of its volume, by which a part read back from its file may differ
SAME_WEIGHT = 0.2
MILLED_MM = 2000.0  # of metal no part is cut to a printer's plate
_NOTHING_MM3 = 1.0


@dataclass(frozen=True, eq=False)
class PrintedTool:
    """A tool as parts; ``mounted``: the tool with its plate or sleeves as components, as it can be simulated.

    ``step`` says whether there is a STEP file.
    """

    parts: tuple[PrintedPart, ...]
    checks: tuple[Check, ...]
    joints: tuple[Dovetails, ...]
    hardware: tuple[str, ...]
    mounted: Tool
    material: Material
    printer: Printer
    step: bool = False

    @property
    def printed(self) -> Tool:
        """`mounted`, weighing what its parts weigh as printed: what an arm really bears."""
        volumes = [self.material.volume_of(component.shape) for component in self.mounted.components]
        share = math.fsum(part.mass_g for part in self.parts) / 1000 / sum(volumes) if self.parts else 0.0
        pairs = zip(self.mounted.components, volumes, strict=True)
        own = tuple(replace(component, mass=share * volume) for component, volume in pairs)
        return replace(self.mounted, components=own) if self.parts else self.mounted

    @property
    def notes(self) -> list[str]:
        """What is not written, and how to get it."""
        return [] if not self.parts or can_write_step() else [NO_STEP]

    @property
    def faults(self) -> list[str]:
        """What speaks against it, and what to change, a line each."""
        return [str(check) for check in printable(self.parts, self.checks) if check.passed is False]

    def figures(self) -> dict[str, Any]:
        """Return all figures as data; ``to_mount`` (4, 4) leads from a part's file to the frame of its mount, mm."""
        parts = [
            {
                "file": self.file(number),
                "of": part.link,
                "size_mm": np.round(part.mesh.extents, 2).tolist(),
                "volume_cm3": round(part.volume_cm3, 3),
                "mass_g": round(part.mass_g, 4),
                "to_mount": np.round(part.to_mount, 6).tolist(),
                "checks": _as_data(part.checks),
            }
            for number, part in enumerate(self.parts)
        ]
        return {
            "printer": vars(self.printer),
            "material": self.material.name if self.material.density_kg_m3 else "pla, solid",
            "mass_g": round(math.fsum(part.mass_g for part in self.parts), 3),
            "parts": parts,
            "joints": [str(joint) for joint in self.joints],
            "hardware": list(self.hardware),
            "step": "tool.step" if self.step else None,
            "checks": _as_data(self.checks),
        }

    def file(self, number: int) -> str:
        return f"part_{number + 1}_of_{len(self.parts)}.stl"


def _as_data(checks: Sequence[Check]) -> dict[str, Any]:
    return {check.name: {"passed": check.passed, "found": check.found} for check in checks}


def pieces(tool: Tool, printer: Printer, material: Material = PAPER) -> list[PrintedPart]:
    """Make the bodies of a tool, one for each mount and for what a joint moves, cut to the plate, without fitting."""
    made, fit, nothing = list[PrintedPart](), Fit(), np.zeros((0, 3))
    for bearer, components in _links(tool).items():
        mount, weld = _welded(components, tool, Mount)
        whole = joined([c.name for c in components], grown(components, tool, weld), weld, printer)
        name, (cuts, joints) = piece_name(bearer), cut(mount.solid, printer, fit, _axes(components, tool), nothing)
        glued = next((Check("joint", False, str(joint)) for joint in joints if not joint.tails), None)
        for number, solid in enumerate(cuts, 1):
            own = (name, whole) if len(cuts) == 1 else (f"{name}_{number}", glued or _single(solid))
            made.append(print_part(own[0], name, solid, weld, own[1], printer, material))
    return made


def _axes(components: Sequence[Component], tool: Tool) -> Array:
    """The directions (3 K, 3) of K components, to which cuts are square."""
    return np.vstack([tool.placed()[c.name][1].rotation.as_matrix().T for c in components])


def _links(tool: Tool) -> dict[str, list[Component]]:
    """The components by what bears them: a mount or, for those that a joint moves, the component with the joint."""
    links: dict[str, list[Component]] = {}
    for component in tool.components:
        links.setdefault(tool.borne[component.name][0], []).append(component)
    return links


def _welded(components: Sequence[Component], tool: Tool, fix: Callable[[Workpiece], Mount]) -> tuple[Mount, float]:
    """Weld components by as little as makes them and their mount one body with a closed surface."""
    for weld in WELDS_MM:
        mount = fix(Workpiece("add", tuple(grown(components, tool, weld))))
        if len(mount.solid.bodies) == 1 and closed(mount.solid.mesh):
            break
    return mount, weld


@dataclass(frozen=True, eq=False)
class _PrintedLink:
    """What one bearer holds, fitted and cut; ``whole``: the check that it is in one piece."""

    bearer: str
    components: Sequence[Component]
    mount: Mount
    weld_mm: float
    whole: Check
    cuts: Sequence[Workpiece]
    joints: Sequence[Dovetails]


def make_tool(tool: Tool, robot: Robot, material: Material, printer: Printer, fit: Fit) -> PrintedTool:
    """Turn a tool into parts that a printer makes; the bare hand has none.

    Raises:
        UserError: the robot's flange can't be fitted.
    """
    parts, checks, joints, hardware = list[PrintedPart](), list[Check](), list[Dovetails](), list[str]()
    if material.metal:
        printer, fit = Printer([MILLED_MM] * 3, printer.min_wall_mm, "milled"), replace(fit, insert_mm=CORE_MM)
    added, hinges = list[Component](), make_hinges(tool, fit, printer)
    links = [_make_link(bearer, own, tool, robot, printer, fit, hinges.cuts) for bearer, own in _links(tool).items()]
    for link in links:
        added += weighed(link.mount, grown(link.components, tool, 0), material)
        checks += [*link.mount.checks, *_faithful(link, tool)]
        for number, joint in enumerate(link.joints, len(joints) + 1):
            checks.append(Check(f"joint {number}", joint.tails > 0, str(joint)))
        for number, solid in enumerate(link.cuts, len(parts) + 1):
            whole = link.whole if len(link.cuts) == 1 else _single(solid)
            of = piece_name(link.bearer), solid, link.weld_mm, whole, printer, material
            parts.append(print_part(f"part_{number}", *of))
        joints += link.joints
        hardware += link.mount.hardware
    checks += [*_apart(tool, links), *hinges.checks]
    hardware += hinges.hardware
    mounted = replace(tool, components=(*tool.components, *added))
    if parts:
        printed, simulated = math.fsum(part.mass_g for part in parts), 1000 * mounted.mass
        said = f"{'milled' if material.metal else 'printed'} it weighs {printed:.0f} g, in simulation {simulated:.0f} g"
        checks.append(Check("weight", abs(printed - simulated) <= SAME_WEIGHT * printed, said))
    return PrintedTool(tuple(parts), tuple(checks), tuple(joints), tuple(hardware), mounted, material, printer)


def _single(solid: Workpiece) -> Check:
    count = len(solid.bodies)
    return Check("one piece", count == 1, "one body" if count == 1 else f"it falls into {count} pieces")


def _make_link(
    bearer: str,
    components: Sequence[Component],
    tool: Tool,
    robot: Robot,
    printer: Printer,
    fit: Fit,
    hinges: Mapping[str, Sequence[Placed]],
) -> _PrintedLink:
    def fix(solid: Workpiece) -> Mount:
        mount = Mount(solid)
        if bearer == RIGID_MOUNT:
            mount = at_flange(robot, tool, components, solid, fit)
        elif bearer in GRIPPER_MOUNTS:
            mount = on_finger(robot, tool, bearer, solid, fit)
        return replace(mount, solid=mount.solid.cut(*hinges.get(bearer, ())))

    mount, weld = _welded(components, tool, fix)
    names = [*(c.name for c in components), *(f"mount {n}" for n in range(len(mount.adding)))]
    whole = joined(names, [*grown(components, tool, weld), *widened(mount.adding, weld)], weld, printer)
    if len(mount.solid.bodies) > 1:
        whole = _single(mount.solid)
    corners = to_mesh(union(mount.adding)).vertices if mount.adding else np.zeros((0, 3))
    cuts, joints = cut(mount.solid, printer, fit, _axes(components, tool), corners)
    return _PrintedLink(bearer, components, mount, weld, whole, cuts, joints)


def _faithful(link: _PrintedLink, tool: Tool) -> list[Check]:
    """Compare the solid with the components that were simulated, apart from what fits it to the arm."""
    off, whole, mount = link.weld_mm + EXACT_MM, link.mount.solid.body, link.mount
    wide, narrow = (_batch([_offset(c, tool, by) for c in link.components]) for by in (off, -off))
    excess = max(0.0, (whole - wide - union(mount.adding)).volume())
    lack = max(0.0, (narrow - union(mount.taking) - whole).volume())
    here = f"{excess:.1f} mm³ too much and {lack:.1f} too little, {off:g} mm off what was simulated"
    checks = [Check("as simulated", excess < _NOTHING_MM3 and lack < _NOTHING_MM3, here)]
    if len(link.cuts) > 1:
        together = _batch([solid.body for solid in link.cuts])
        over, gaps = (together - whole).volume(), (whole - together).volume()
        rest = f"{over:.1f} mm³ too much; gaps of {gaps / whole.volume():.2%} of it"
        checks.append(Check("put together", over < _NOTHING_MM3 and gaps < 0.03 * whole.volume(), rest))
    return checks


def _batch(bodies: Sequence[Any]) -> Any:
    import manifold3d

    return manifold3d.Manifold.batch_boolean(bodies, manifold3d.OpType.Add)


def _offset(component: Component, tool: Tool, by: float) -> Any:
    """Move the sides of a component out, or in: of one that is not convex by Minkowski's sum with a cube."""
    import manifold3d

    if not isinstance(component.shape, Compound):
        return union(grown([component], tool, by))
    exact, cube = union(grown([component], tool, 0)), manifold3d.Manifold.cube((2 * abs(by),) * 3, True)
    return exact.minkowski_sum(cube) if by > 0 else exact.minkowski_difference(cube)


def _apart(tool: Tool, links: Sequence[_PrintedLink]) -> list[Check]:
    """Check that bodies that joints part do not share space at rest."""
    placed, checks = tool.placed(), list[Check]()
    for one, other in itertools.combinations(links, 2):
        if placed[one.components[0].name][0] == placed[other.components[0].name][0]:
            shared = (one.mount.solid.body ^ other.mount.solid.body).volume()
            said = f"{piece_name(one.bearer)} and {piece_name(other.bearer)} share {shared / 1000:.2f} cm³ at rest"
            if shared >= _NOTHING_MM3:
                checks.append(Check("apart", False, said))
    return checks


def write_tool(made: PrintedTool, folder: Path) -> PrintedTool:
    """Write STL, 3MF, STEP if it can be, and lists (`write_lists`); add a check for what is not in the STEP file.

    Raises:
        UserError: a file can't be written.
    """
    if not made.parts:
        return made
    files = {made.file(number): part for number, part in enumerate(made.parts)}
    for name, part in files.items():
        write_bytes(folder / name, to_stl(part))
    most = max(_difference(folder / name, part) for name, part in files.items())
    read = Check("files read back", most <= SAME_FILE, f"STL files differ from the parts by up to {most:.2%} in volume")
    if not made.material.metal:
        write_bytes(folder / "tool.3mf", to_3mf(made.parts))
    missing = write_step({name: part.solid for name, part in files.items()}, folder / "tool.step")
    checks = [Check("STEP", False, f"{name} can't be modelled") for name in missing]
    made = replace(made, checks=(read, *checks, *made.checks), step=can_write_step() and len(missing) < len(files))
    write_lists(made, folder)
    return made


def _difference(file: Path, part: PrintedPart) -> float:
    """Measure what a part and its file don't share, as a share of the part; 1 or more where the file isn't closed."""
    import trimesh

    read, whole = manifold(trimesh.load_mesh(file).apply_transform(part.to_mount)), part.solid.body
    return float(((read - whole).volume() + (whole - read).volume()) / whole.volume())


def write_lists(made: PrintedTool, folder: Path) -> None:
    """Write ``print.json`` and ``assembly.md``: the parts, what joins them, what is bought, what speaks against it.

    Raises:
        UserError: a file can't be written.
    """
    write_bytes(folder / "print.json", (json.dumps(made.figures(), indent=2) + "\n").encode())
    write_bytes(folder / "assembly.md", filled("assembly.md.j2", made=made).encode())
