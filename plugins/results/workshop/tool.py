"""Make a tool's printed parts: solids that fit the arm and the printer, their files, and what speaks against them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import trimesh

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.support.cli import write_bytes
from core.values.materials import Material
from core.values.robots import Robot
from plugins.results.workshop.body import check_apart, check_faithful, fuse
from plugins.results.workshop.flange import at_flange
from plugins.results.workshop.mount import Mount, weighed
from plugins.results.workshop.printing import (
    Check,
    PrintedPart,
    grams,
    is_metal,
    to_stl,
)
from plugins.results.workshop.settings import Fit, Printer
from plugins.results.workshop.sleeve import CORE_MM, on_finger
from plugins.results.workshop.solid import ToolLink, links_of, manifold

SAME_FILE = 0.001  # of its volume, by which a part read back from its file may differ
SAME_WEIGHT = 0.2


@dataclass(frozen=True, eq=False)
class PrintedTool:
    """A tool as parts that a printer makes.

    Attributes:
        tool: as it was designed.
        parts: one for each of its rigid links; none of the bare hand.
        checks: of the whole tool; those of its parts are theirs.
        hardware: what is bought.
        mounted: the tool with its plate or sleeves as components, as it can be simulated.
        material: what it is made of.
    """

    tool: Tool
    parts: tuple[PrintedPart, ...]
    checks: tuple[Check, ...]
    hardware: tuple[str, ...]
    mounted: Tool
    material: Material

    @property
    def verdicts(self) -> list[Check]:
        """What was checked of its parts, and of the whole."""
        of_parts = chain.from_iterable(part.checks for part in self.parts)
        return [*of_parts, *self.checks]

    @property
    def printed(self) -> Tool:
        """`mounted`, weighing what its parts weigh as printed: what an arm really bears."""
        if not self.parts:
            return self.mounted

        components = self.mounted.components
        volumes = [self.material.volume_of(part.shape) for part in components]
        density = grams(self.parts) / 1000 / sum(volumes)
        weighing = [
            replace(component, mass=density * volume)
            for component, volume in zip(components, volumes, strict=True)
        ]

        return replace(self.mounted, components=tuple(weighing))


def make_tool(
    tool: Tool, robot: Robot, material: Material, printer: Printer, fit: Fit
) -> PrintedTool:
    """Turn a tool into parts that a printer makes; the bare hand has none.

    Args:
        tool: as it was designed.
        robot: the arm that it is fitted to.
        material: of its parts; metal is milled, and takes threads.
        printer: whose plate and thinnest wall count.
        fit: the clearances of what joins it to the arm.

    Raises:
        UserError: the robot's flange can't be fitted.
    """
    if is_metal(material):
        fit = replace(fit, insert_mm=CORE_MM)

    links = links_of(tool)
    fitted = [fuse(link, printer, partial(_mount, robot, link, fit)) for link in links]
    parts = [body.printed(printer, material) for body in fitted]

    taken = [component.name for component in tool.components]
    added = list[Component]()
    checks = list[Check]()
    hardware = list[str]()
    for body in fitted:
        added += weighed(body.mount, body.link, taken, material)
        checks += [*body.mount.checks, check_faithful(body)]
        hardware += body.mount.hardware

    checks += check_apart(fitted)

    for link in links:
        if link.joint is not None:
            to_make = f"the {link.joint.kind} is to be made by the workshop"
            mend = "each of its links is a closed body of its own"
            checks.append(Check("joint", None, to_make, mend, link.name))

    mounted = replace(tool, components=(*tool.components, *added))
    if parts:
        printed = grams(parts)
        simulated = 1000 * mounted.mass
        how = "milled" if is_metal(material) else "printed"
        weighs = f"{how} it weighs {printed:.0f} g, in simulation {simulated:.0f} g"
        same = abs(printed - simulated) <= SAME_WEIGHT * printed
        mend = "search again with the material that it is made of, such as material=pla"
        checks.append(Check("weight", same, weighs, mend))

    return PrintedTool(
        tool, tuple(parts), tuple(checks), tuple(hardware), mounted, material
    )


def _mount(robot: Robot, link: ToolLink, fit: Fit, solid: Any) -> Mount:
    """Fit a link's solid to the flange or the finger that bears it."""
    if link.bearer == RIGID_MOUNT:
        return at_flange(robot, link, solid, fit)
    if link.bearer in GRIPPER_MOUNTS:
        return on_finger(robot, link, solid, fit)

    return Mount(solid)


def write_tool(printed_tool: PrintedTool, folder: Path) -> PrintedTool:
    """Write an STL file of each part.

    Returns:
        The tool with a check of the files.

    Raises:
        UserError: a file can't be written.
    """
    if not printed_tool.parts:
        return printed_tool

    # What a part and its file don't share, as a share of the part: 1 or more where the file isn't closed.
    most = 0.0
    for part in printed_tool.parts:
        file = folder / part.file
        write_bytes(file, to_stl(part))
        written = manifold(trimesh.load_mesh(file).apply_transform(part.to_mount))
        excess = (written - part.solid).volume()
        lack = (part.solid - written).volume()
        most = max(most, float((excess + lack) / part.solid.volume()))

    differ = f"STL files differ from the parts by up to {most:.2%} in volume"
    mend = "write them again; if it stays, thicken what is thinner than a nozzle"
    same = Check("files read back", most <= SAME_FILE, differ, mend)

    return replace(printed_tool, checks=(*printed_tool.checks, same))
