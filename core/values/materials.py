"""Define what tools are made of, and weigh them by it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from core.errors import UsageError, check_positive
from core.geometry import Shape
from core.values.harmless import Harmless
from core.values.tools import Tool

METAL_KG_M3 = 2000.0
"""Metals are denser, plastics are not."""

STEEL_PA = 200e9  # Young's modulus; hardly a material that tools are made of is stiffer


@dataclass(unsafe_hash=True)
class Material:
    """A material, and how much of a component is filled with it. The defaults are ``paper``.

    Attributes:
        name: as in ``material=NAME``.
        density_kg_m3: of the solid; None: a component weighs what its design says, as in the paper.
        infill: the share of the space inside the walls that is filled; 1: solid.
        wall_mm: the thickness of the walls.
        friction: of a rigid tool; None: what the tool has, by default 0.5.
        young_pa: Young's modulus, by which tools bend.
        strength_pa: the largest stress that is allowed; None: any.
        most_g: the budget of material: how much a tool may weigh in all; None: what the arm carries.

    Raises:
        UsageError: a number is not finite, or out of its range.
    """

    name: Harmless[str] = "paper"
    density_kg_m3: float | None = None
    infill: float = 1.0
    wall_mm: float = 0.0
    friction: float | None = None
    young_pa: float = STEEL_PA
    strength_pa: float | None = None
    most_g: float | None = None

    def __post_init__(self) -> None:
        names = ("density_kg_m3", "young_pa", "strength_pa", "most_g")
        check_positive("material.", **{name: getattr(self, name) for name in names})

        if not 0.01 <= self.infill <= 1:
            raise UsageError(
                f"material.infill is a share, 0.01 to 1, got {self.infill}"
            )

        for name in ("wall_mm", "friction"):
            value = getattr(self, name)
            if value is not None and not 0 <= value < math.inf:
                raise UsageError(
                    f"material.{name} must be 0 or greater, and finite, got {value}"
                )

    @property
    def is_metal(self) -> bool:
        """Whether parts of it are milled, and not printed."""
        return (self.density_kg_m3 or 0.0) >= METAL_KG_M3

    @property
    def filling(self) -> str:
        """How components are filled with it, in words."""
        if self.infill == 1:
            return "solid"
        return f"walls of {self.wall_mm:g} mm, filled to {self.infill:.0%} inside"

    def volume_of(self, shape: Shape) -> float:
        """Compute the volume of the material in a component of this shape, m^3."""
        wall = self.wall_mm / 1000
        return shape.volume - (1 - self.infill) * shape.volume_inside(wall)

    def made(self, tool: Tool) -> Tool:
        """Return the tool as made of this material: with its friction, and its masses if they follow from it."""
        if self.friction is not None:
            tool = replace(tool, friction=self.friction)
        if self.density_kg_m3 is not None:
            weighed = []
            for component in tool.components:
                mass = self.density_kg_m3 * self.volume_of(component.shape)
                weighed.append(replace(component, mass=mass))
            tool = replace(tool, components=tuple(weighed))
        return tool


PAPER = Material()
