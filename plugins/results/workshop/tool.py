"""Make a tool's printed parts: solids that fit the arm and the printer, their files, and what speaks against them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import manifold3d
import trimesh

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Tool
from core.geometry import Compound
from core.support.cli import write_bytes
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.fitting import (
    CORE_MM,
    Mount,
    at_flange,
    on_finger,
    weighed,
)
from plugins.results.workshop.printing import (
    Check,
    PrintedPart,
    grams,
    joined,
    lay,
    print_part,
    to_stl,
)
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.solid import (
    UNEVEN,
    WELDS_MM,
    Placed,
    ToolLink,
    closed,
    links_of,
    manifold,
    to_mesh,
    union,
    widened,
)

EXACT_MM = 0.1  # by which the solid may differ from what was simulated
SAME_FILE = 0.001  # of its volume, by which a part read back from its file may differ
SAME_WEIGHT = 0.2
_NOTHING_MM3 = 1.0


@dataclass(frozen=True, eq=False)
class PrintedTool:
    """A tool as parts; ``mounted``: the tool with its plate or sleeves as components, as it can be simulated."""

    tool: Tool
    parts: tuple[PrintedPart, ...]
    checks: tuple[Check, ...]
    hardware: tuple[str, ...]
    mounted: Tool
    material: Material

    @property
    def printed(self) -> Tool:
        """`mounted`, weighing what its parts weigh as printed: what an arm really bears."""
        volumes = [
            self.material.volume_of(component.shape)
            for component in self.mounted.components
        ]
        share = grams(self.parts) / 1000 / sum(volumes) if self.parts else 0.0
        pairs = zip(self.mounted.components, volumes, strict=True)
        own = tuple(
            replace(component, mass=share * volume) for component, volume in pairs
        )
        return replace(self.mounted, components=own) if self.parts else self.mounted


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid link of a tool as one closed solid.

    Attributes:
        mount: the solid, fitted to what bears it.
        weld_mm: by how much its components were moved out to become one.
        whole: the check that it is in one piece.
    """

    link: ToolLink
    mount: Mount
    weld_mm: float
    whole: Check

    def printed(self, printer: Printer, material: Material) -> PrintedPart:
        """Lay it on a printer's plate, and check it."""
        return print_part(
            self.link.name,
            self.mount.solid,
            self.weld_mm,
            self.whole,
            printer,
            material,
        )


def bodies(tool: Tool, printer: Printer | None = None) -> list[Body]:
    """Make each rigid link of a tool one closed solid, as it was simulated: not fitted to an arm."""
    return [_fuse(link, printer or Printer()) for link in links_of(tool)]


def make_tool(
    tool: Tool, robot: Robot, material: Material, printer: Printer, fit: Fit
) -> PrintedTool:
    """Turn a tool into parts that a printer makes; the bare hand has none.

    Raises:
        UserError: the robot's flange can't be fitted.
    """
    if material.metal:
        fit = replace(fit, insert_mm=CORE_MM)
    links = links_of(tool)
    fitted = [
        _fuse(link, printer, partial(_mounted, robot, link, fit)) for link in links
    ]
    parts = [body.printed(printer, material) for body in fitted]
    checks = [
        check for each in fitted for check in (*each.mount.checks, _faithful(each))
    ]
    checks += [*_apart(fitted), *_joints(links)]
    hardware = [item for each in fitted for item in each.mount.hardware]
    taken = [component.name for component in tool.components]
    added = [
        component
        for each in fitted
        for component in weighed(each.mount, each.link, taken, material)
    ]
    mounted = replace(tool, components=(*tool.components, *added))
    if parts:
        printed = grams(parts)
        simulated = 1000 * mounted.mass
        said = f"{'milled' if material.metal else 'printed'} it weighs {printed:.0f} g, in simulation {simulated:.0f} g"
        checks.append(
            Check("weight", abs(printed - simulated) <= SAME_WEIGHT * printed, said)
        )
    return PrintedTool(
        tool, tuple(parts), tuple(checks), tuple(hardware), mounted, material
    )


def _mounted(robot: Robot, link: ToolLink, fit: Fit, solid: Any) -> Mount:
    """Fit a link's solid to the flange or the finger that bears it."""
    if link.bearer == RIGID_MOUNT:
        return at_flange(robot, link, solid, fit)
    if link.bearer in GRIPPER_MOUNTS:
        return on_finger(robot, link, solid, fit)
    return Mount(solid)


def _fuse(
    link: ToolLink, printer: Printer, fix: Callable[[Any], Mount] = Mount
) -> Body:
    """Weld a link by as little as makes it and its mount one body that is closed, also as it lies on the plate."""
    for weld, uneven in itertools.product(WELDS_MM, (0.0, UNEVEN)):
        shapes = link.grown(weld, uneven)
        mount = fix(union(shapes))
        mesh = to_mesh(mount.solid)
        single = len(mount.solid.decompose()) == 1
        if single and closed(mesh) and closed(lay(mesh, printer.plate_mm)[0]):
            break
    names = [*link.names, *(f"mount {n}" for n in range(len(mount.adding)))]
    whole = joined(names, [*shapes, *widened(mount.adding, weld)], weld, printer)
    if whole.passed and not single:
        whole = Check(
            "one piece", False, f"it falls into {len(mount.solid.decompose())} pieces"
        )
    return Body(link, mount, weld, whole)


def _faithful(fitted: Body) -> Check:
    """Compare the solid with the components that were simulated, apart from what fits it to the arm."""
    off = fitted.weld_mm + EXACT_MM
    whole = fitted.mount.solid
    mount = fitted.mount
    solids = (
        [_offset(shape, by) for shape in fitted.link.shapes] for by in (off, -off)
    )
    wide, narrow = (
        manifold3d.Manifold.batch_boolean(each, manifold3d.OpType.Add)
        for each in solids
    )
    excess = max(0.0, (whole - wide - union(mount.adding)).volume())
    lack = max(0.0, (narrow - union(mount.taking) - whole).volume())
    here = f"{excess:.1f} mm³ too much and {lack:.1f} too little, {off:g} mm off what was simulated"
    return Check("as simulated", excess < _NOTHING_MM3 and lack < _NOTHING_MM3, here)


def _offset(placed: Placed, by: float) -> Any:
    """Move the sides of a shape out, or in: of one that is not convex by Minkowski's sum with a cube."""
    if not isinstance(placed[0], Compound):
        return union(widened([placed], by))
    cube = manifold3d.Manifold.cube((2 * abs(by),) * 3, True)
    return (
        union([placed]).minkowski_sum(cube)
        if by > 0
        else union([placed]).minkowski_difference(cube)
    )


def _apart(links: Sequence[Body]) -> list[Check]:
    """Check that bodies do not share space at rest, apart from those of one joint, which a workshop makes."""
    checks = []
    for one, other in itertools.combinations(links, 2):
        joined = (
            one.link.bearer == other.link.parent or other.link.bearer == one.link.parent
        )
        if one.link.mount == other.link.mount and not joined:
            shared = (one.mount.solid ^ other.mount.solid).volume()
            said = f"{one.link.name} and {other.link.name} share {shared / 1000:.2f} cm³ at rest"
            if shared >= _NOTHING_MM3:
                checks.append(Check("apart", False, said))
    return checks


def _joints(links: Sequence[ToolLink]) -> list[Check]:
    """Say of each joint that it is not part of the solids."""
    joints = [(link.name, link.joint.kind) for link in links if link.joint is not None]
    return [
        Check(f"joint of {name}", None, f"the {kind} is to be made by the workshop")
        for name, kind in joints
    ]


def write_tool(made: PrintedTool, folder: Path) -> PrintedTool:
    """Write an STL file of each part.

    Returns:
        The tool with a check of the files.

    Raises:
        UserError: a file can't be written.
    """
    if not made.parts:
        return made
    most = 0.0  # of what a part and its file don't share, as a share of the part; 1 or more where the file isn't closed
    for part in made.parts:
        file = folder / part.file
        write_bytes(file, to_stl(part))
        whole = part.solid
        read = manifold(trimesh.load_mesh(file).apply_transform(part.to_mount))
        most = max(
            most,
            float(((read - whole).volume() + (whole - read).volume()) / whole.volume()),
        )
    same = Check(
        "files read back",
        most <= SAME_FILE,
        f"STL files differ from the parts by up to {most:.2%} in volume",
    )
    return replace(made, checks=(*made.checks, same))
