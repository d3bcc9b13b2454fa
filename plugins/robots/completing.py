"""Fill in what industrial arms' files lack, as settings say: collision shapes, and masses."""

from __future__ import annotations

from dataclasses import replace

from core.errors import UsageError, check_positive
from core.robot.description import merge_inertias, weigh
from core.robot.meshes import solid_of
from core.values.descriptions import (
    DIGITS,
    Description,
    Inertial,
    RobotLink,
    Weight,
)
from plugins.robots.arm_settings import ArmSettings
from plugins.robots.hulls import make_all, make_shape


def complete(
    description: Description, chosen: ArmSettings, notes: list[str]
) -> Description:
    """Fill in what is missing, as settings say.

    Raises:
        UserError: see `_spread_mass`.
    """
    if chosen.collision == "visual":
        links = {
            name: replace(link, collisions=link.collisions or link.visuals)
            for name, link in description.links.items()
        }
        description = replace(description, links=links)
    if chosen.mass_kg is None:
        return description

    return _spread_mass(description, chosen.mass_kg, notes)


def _spread_mass(
    description: Description, mass_kg: float, notes: list[str]
) -> Description:
    """Give links without mass or inertia those of their hulls, at one density for all.

    Args:
        description: of the robot.
        mass_kg: of all links together; masses that the file has stay.
        notes: get a line if that changes no mass.

    Raises:
        UsageError: it is no more than what the file has.
        UserError: a mesh can't be used.
    """
    check_positive("robot.", mass_kg=mass_kg)
    known = sum(link.inertial.mass for link in description.links.values())
    lacking = [
        link
        for link in description.links.values()
        if link.collisions and not (link.inertial.mass and any(link.inertial.moments))
    ]
    make_all(lacking)
    solids = {link.name: merge_inertias(_weigh(link)) for link in lacking}
    volume = sum(
        solid[0]
        for name, solid in solids.items()
        if not description.links[name].inertial.mass
    )
    if volume and mass_kg <= known:
        raise UsageError(
            f"robot.mass_kg={mass_kg:g} is for the whole arm, but the masses in the file are {known:g} kg already"
        )

    if not volume:
        notes.append(
            f"robot.mass_kg={mass_kg:g} changes no mass: links with collision shapes have {known:g} kg in the file"
        )

    links = dict(description.links)
    for name, (space, center, tensor) in solids.items():
        mass = links[name].inertial.mass or (mass_kg - known) * space / volume
        whole = Inertial.from_tensor(mass, center, tensor * mass / space, DIGITS)
        links[name] = replace(links[name], inertial=whole)

    return replace(description, links=links)


def _weigh(link: RobotLink) -> list[Weight]:
    """Weigh the hulls of a link's collision shapes at 1 kg/m^3, in its frame."""
    weights = []
    for shape in link.collisions:
        solid = solid_of(make_shape(shape, drawn=False))
        weights.append(weigh(solid, solid.volume, shape.origin.pose))

    return weights
