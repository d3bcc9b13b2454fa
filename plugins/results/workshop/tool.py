"""Make a tool's printed parts: solids that fit the arm and the printer, their files, and what speaks against them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.support.cli import write_bytes
from core.support.templates import macros
from core.values.materials import Material
from core.values.printers import Printer
from core.values.robots import Robot
from plugins.results.workshop.body import Body, check_apart, fuse
from plugins.results.workshop.cutting import Pieces, cut_to_fit
from plugins.results.workshop.flange import at_flange
from plugins.results.workshop.joints import SCREWS, Joint
from plugins.results.workshop.mount import Mount, weighed
from plugins.results.workshop.numbering import engrave
from plugins.results.workshop.plates import arrange, to_3mf
from plugins.results.workshop.printing import (
    Check,
    PrintedPart,
    grams,
    print_part,
    to_stl,
)
from plugins.results.workshop.settings import Fit
from plugins.results.workshop.sleeve import CORE_MM, on_finger
from plugins.results.workshop.solid import ToolLink, links_of

SAME_WEIGHT = 0.2


_SWITCH = (
    "the drivers don't switch the pump: let it run while the motion's fingers are nearer to closed than to open, and "
    "leave room for its hose"
)


@dataclass(frozen=True, eq=False)
class PrintedTool:
    """A tool as parts that a printer makes.

    Attributes:
        tool: as it was designed.
        parts: for each of its rigid links one, or the pieces that it was cut into; none of the bare hand.
        checks: of the whole tool; those of its parts are theirs.
        hardware: what is bought.
        mounted: the tool with its plate or sleeves and its joints as components, as it can be simulated.
        material: what it is made of.
        joints: between the parts that links were cut into.
        bodies: its links, before they were cut.
        sliced: what a slicer says of the parts (`plugins.results.workshop.slicing.ask_slicer`); empty: none was asked.
    """

    tool: Tool
    parts: tuple[PrintedPart, ...]
    checks: tuple[Check, ...]
    hardware: tuple[str, ...]
    mounted: Tool
    material: Material
    joints: tuple[Joint, ...] = ()
    bodies: tuple[Body, ...] = ()
    sliced: Mapping[str, Any] = field(default_factory=dict)

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

        bought = {joint.name for joint in self.joints}
        volumes = {
            component.name: self.material.volume_of(component.shape)
            for component in self.mounted.components
            if component.name not in bought
        }
        density = grams(self.parts) / 1000 / sum(volumes.values())
        weighing = [
            component
            if component.name in bought
            else replace(component, mass=density * volumes[component.name])
            for component in self.mounted.components
        ]

        return replace(self.mounted, components=tuple(weighing))

    @property
    def mass_g(self) -> float:
        """The mass of all parts, with the screws of their joints."""
        return grams(self.parts) + sum(joint.mass_g for joint in self.joints)

    def with_checks(self, *checks: Check) -> PrintedTool:
        """Return it with further checks."""
        return replace(self, checks=(*self.checks, *checks))


def _check_grips(tool: Tool, hardware: list[str]) -> Iterator[Check]:
    """Add what is bought to grip with to the hardware, and yield what nobody can check."""
    for component in tool.gripping:
        grip = component.grips
        assert grip is not None
        hardware.append(f"for {component.name}: {grip.parts}")
        if grip.switched:
            yield Check("grips", None, _SWITCH, part=component.name)


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
    if material.is_metal:
        fit = replace(fit, insert_mm=CORE_MM)

    links = links_of(tool)
    fitted = [fuse(link, printer, partial(_mount, robot, link, fit)) for link in links]
    parts, joints = _print_all(fitted, printer, fit, material)

    taken = [component.name for component in tool.components]
    added = list[Component]()
    checks = list[Check]()
    hardware = list[str]()
    for body in fitted:
        added += weighed(body.mount, body.link, taken, material)
        checks += body.mount.checks
        hardware += body.mount.hardware

    screws = Counter(joint.screw for joint in joints)
    for screw, count in screws.items():
        hardware += [
            f"{SCREWS * count} x {screw} countersunk screw",
            f"{SCREWS * count} brass inserts M3 for a bore of {fit.insert_mm:g} mm",
        ]

    checks += _check_grips(tool, hardware)
    checks += check_apart(fitted)

    for link in links:
        if link.joint is not None:
            to_make = f"the {link.joint.kind} is to be made by the workshop"
            checks.append(Check("joint", None, to_make, part=link.name))

    bearers = {name: body.link.bearer for body in fitted for name in body.link.names}
    added += [joint.as_component(bearers[joint.component]) for joint in joints]
    mounted = replace(tool, components=(*tool.components, *added))
    if parts:
        printed = grams(parts) + sum(joint.mass_g for joint in joints)
        simulated = 1000 * mounted.mass
        words = macros("plugins.results.workshop", "words")
        weighs = words.weighs(material.is_metal, printed, simulated)
        same = abs(printed - simulated) <= SAME_WEIGHT * printed
        mend = "thicken what is thin: there the walls weigh more than the rest"
        if not material.density_kg_m3:
            mend = "search again with the material that it is made of, such as material=pla"
        checks.append(Check("weight", same, weighs, mend))

    return PrintedTool(
        tool,
        tuple(parts),
        tuple(checks),
        tuple(hardware),
        mounted,
        material,
        tuple(joints),
        tuple(fitted),
    )


def _print_all(
    fitted: Sequence[Body], printer: Printer, fit: Fit, material: Material
) -> tuple[list[PrintedPart], list[Joint]]:
    """Cut links that don't fit the plate, number their pieces, and lay all parts on it; what is milled stays whole.

    Args:
        fitted: the links of a tool, with what fits them to the arm.
        printer: whose plate counts.
        fit: the gaps of joints.
        material: of the tool.
    """
    cut = []
    for body in fitted:
        solid = body.mount.solid
        if material.is_metal:
            cut.append(Pieces((solid,)))
        else:
            cut.append(cut_to_fit(solid, body.link, printer, fit, material))

    taken = [name for body in fitted for name in body.link.names]
    several = any(pieces.joints for pieces in cut)
    parts = list[PrintedPart]()
    joints = list[Joint]()
    for body, pieces in zip(fitted, cut, strict=True):
        before = len(parts) + 1
        for joint in pieces.joints:
            below, above = joint.find_pieces(pieces.solids)
            name = f"joint_{len(joints) + 1}"
            while name in taken:
                name += "_"
            pair = (before + below, before + above)
            joints.append(replace(joint, name=name, pieces=pair))

        known = [body.one_piece._replace(part=body.link.name)]
        for whole in pieces.solids:
            number = len(parts) + 1
            name = f"{body.link.name}_{number}" if several else body.link.name
            solid = engrave(whole, number) if several else whole
            part = print_part(
                name,
                body.link,
                solid,
                body.weld_mm,
                printer,
                material,
                known,
                pieces.advice,
            )
            parts.append(part)
            known = []

    return parts, joints


def _mount(robot: Robot, link: ToolLink, fit: Fit, solid: Any) -> Mount:
    """Fit a link's solid to the flange or the finger that bears it."""
    if link.bearer == RIGID_MOUNT:
        return at_flange(robot, link, solid, fit)
    if link.bearer in GRIPPER_MOUNTS:
        return on_finger(robot, link, solid, fit)

    return Mount(solid)


def write_tool(printed_tool: PrintedTool, folder: Path, printer: Printer) -> None:
    """Write an STL file of each part, and a 3MF file of all as they lie on plates; of several plates each one, too.

    Raises:
        UserError: a file can't be written.
    """
    for part in printed_tool.parts:
        write_bytes(folder / part.file, to_stl(part))

    if printed_tool.parts and not printed_tool.material.is_metal:
        plates = arrange(printed_tool.parts, printer)
        write_bytes(folder / "tool.3mf", to_3mf(plates, printer))
        for number, plate in enumerate(plates, 1):
            if len(plates) > 1:
                write_bytes(folder / f"plate_{number}.3mf", to_3mf([plate], printer))
