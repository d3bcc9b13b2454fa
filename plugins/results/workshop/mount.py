"""What fits a link of a tool to what bears it, as a solid and as components that can be simulated.

Lengths of settings are millimetres, all else metres, in the frame of the mount.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from core.design import Component
from core.values.materials import Material
from plugins.results.workshop.printing import PLA_G_PER_CM3, Check
from plugins.results.workshop.solid import Placed, ToolLink, union

LEAST_KG = 1e-4


@dataclass(frozen=True)
class Mount:
    """A solid that is fitted to the arm.

    Attributes:
        solid: a Manifold, with what was added to its components, and without what was taken away.
        name: what was added, as in the names of components.
        simulated: shapes like those that were added, as components.
        clearing: the shapes that were taken away first.
        adding: the shapes that were added then, and ``taking`` those that were taken away from all of it.
        checks: what was checked.
        hardware: what is bought.
    """

    solid: Any
    name: str = ""
    simulated: tuple[Placed, ...] = ()
    clearing: tuple[Placed, ...] = ()
    adding: tuple[Placed, ...] = ()
    taking: tuple[Placed, ...] = ()
    checks: tuple[Check, ...] = ()
    hardware: tuple[str, ...] = ()


def weighed(
    mount: Mount, link: ToolLink, taken: Collection[str], material: Material
) -> list[Component]:
    """Return what a mount adds as components, with the mass of what is not in the link.

    Args:
        mount: whose simulated shapes become components.
        link: the link that it is part of.
        taken: names that components of the tool have already.
        material: of the tool; one without a density counts as solid PLA.
    """
    if not mount.simulated:
        return []
    added = union(mount.simulated)
    share = (added - union(link.grown(0))).volume() / added.volume()
    density = share * (material.density_kg_m3 or 1000 * PLA_G_PER_CM3)

    components = []
    for number, (shape, pose) in enumerate(mount.simulated):
        name = f"{mount.name}_{number}" if number else mount.name
        while name in taken:
            name += "_"
        mass = max(LEAST_KG, density * material.volume_of(shape))
        components.append(Component(name, link.bearer, pose, shape, mass))

    return components
