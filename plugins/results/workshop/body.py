"""Make each rigid link of a tool one closed solid, fitted to what bears it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from core.design import Tool
from core.values.printers import Printer
from plugins.results.workshop.lying import lay
from plugins.results.workshop.mount import Mount
from plugins.results.workshop.printing import (
    OVERLAP,
    Check,
    joined,
)
from plugins.results.workshop.solid import (
    UNEVEN,
    WELDS_MM,
    ToolLink,
    closed,
    links_of,
    to_mesh,
    union,
    widened,
)

NOTHING_MM3 = 1.0


@dataclass(frozen=True, eq=False)
class Body:
    """A rigid link of a tool as one closed solid.

    Attributes:
        mount: the solid, fitted to what bears it.
        weld_mm: by how much its components were moved out to become one.
        one_piece: the check that it is in one piece.
    """

    link: ToolLink
    mount: Mount
    weld_mm: float
    one_piece: Check


def bodies(tool: Tool, printer: Printer | None = None) -> list[Body]:
    """Make each rigid link of a tool one closed solid, as it was simulated: not fitted to an arm."""
    return [fuse(link, printer or Printer()) for link in links_of(tool)]


def fuse(
    link: ToolLink, printer: Printer, mount_to: Callable[[Any], Mount] = Mount
) -> Body:
    """Make a link and its mount one closed body.

    Its components are welded by as little as makes it closed and in one piece, also as it lies on the plate.

    Args:
        link: the tool's link.
        printer: whose plate and thinnest wall count.
        mount_to: fits the link's solid, a Manifold in millimetres, to what bears it.

    Returns:
        The body; where no weld does it, that of the widest one, whose checks fail.
    """
    for weld_mm, uneven in itertools.product(WELDS_MM, (0.0, UNEVEN)):
        shapes = link.grown(weld_mm, uneven)
        mount = mount_to(union(shapes))
        pieces = len(mount.solid.decompose())
        if pieces == 1:
            mesh = to_mesh(mount.solid)
            if closed(mesh) and closed(lay(mesh, printer.plate_mm).mesh):
                break

    names = [*link.names, *(f"mount {number}" for number in range(len(mount.adding)))]
    one_piece = joined(
        names, [*shapes, *widened(mount.adding, weld_mm)], weld_mm, printer
    )
    if one_piece.passed and pieces != 1:
        found = f"it falls into {pieces} pieces"
        one_piece = Check("one piece", False, found, OVERLAP)

    return Body(link, mount, weld_mm, one_piece)


def check_apart(links: Sequence[Body]) -> list[Check]:
    """Check that bodies do not share space at rest, apart from those of one joint, which a workshop makes."""
    checks = []
    for first, second in itertools.combinations(links, 2):
        bearers = {first.link.bearer, second.link.bearer}
        jointed = bearers & {first.link.parent, second.link.parent}
        if first.link.mount != second.link.mount or jointed:
            continue

        shared = (first.mount.solid ^ second.mount.solid).volume()
        if shared >= NOTHING_MM3:
            names = f"{first.link.name} and {second.link.name}"
            share = f"{names} share {shared / 1000:.2f} cm³ at rest"
            checks.append(Check("apart", False, share, "leave a gap between them"))

    return checks
