"""Estimate how far a tool bends, as beams, and refuse tools that bend too far or would break.

The beams follow each other from the mount to a tip. A force F across a beam moves its tip by F times the integral of
r^2 / (E I), r being the distance from the tip (beam theory of Euler and Bernoulli), and stresses the outside of a
section of thickness t with F r t / 2 I. Torsion is left out, and so is that parallel chains of components bear a load
together. What is printed with walls and infill has the second moment of area I of its walls, and of its inside times
the infill.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from core.design import DesignError, Tool
from core.designs.rules import MAX_BEND_M_N, MAX_LOAD_N, check_contacts
from core.geometry import Array
from core.interfaces import Material, Robot
from core.values.refusals import DesignReason

POINT_M = 1e-6  # what is shorter is no beam, and has no section


class Beam(NamedTuple):
    """A part of a component that bends: L / E I and t / 2 I are those of its section.

    Attributes:
        start: (3,) where it is held, in its mount's frame.
        stop: (3,) where it ends.
        softness: its length over E I, 1/(N m).
        weakness: half its thickness over I, 1/m^3.
    """

    start: Array
    stop: Array
    softness: float
    weakness: float


class Beams:
    """The components of a tool as beams.

    Args:
        tool: of components that touch each other.
        joints: for each component the point (3,) where it touches its parent, in its mount's frame.
        material: what the tool is made of.

    Attributes:
        chains: what carries each component, from the mount on: each carrier's name, and its beam up to the next joint.
    """

    def __init__(
        self, tool: Tool, joints: Mapping[str, Array], material: Material
    ) -> None:
        self.tool = tool
        self.joints = joints
        self.material = material
        self._poses = {name: pose for name, (_, pose) in tool.placed().items()}
        self._shapes = {c.name: c.shape for c in tool.components}
        self.chains: dict[str, list[tuple[str, Beam]]] = {}

        for component in tool.components:
            parent = component.parent
            chain = list(self.chains.get(parent, ()))
            if parent in self._shapes:
                beam = self.beam(parent, joints[component.name])
                chain.append((parent, beam))

            self.chains[component.name] = chain

    def bending(self) -> dict[str, tuple[float, float]]:
        """Estimate for each component what a newton at its far end does: how far that moves, and the largest stress.

        The stress, in pascals, is that of the component or of what carries it.
        """
        bends = {}

        for component in self.tool.components:
            name = component.name
            ends = self._poses[name].apply(component.shape.corners)
            away = np.linalg.norm(ends - self.joints[name], axis=1)
            bends[name] = self.bend(name, ends[away.argmax()])

        return bends

    def bend(self, name: str, point: Array) -> tuple[float, float]:
        """Estimate what a newton at a point of a component does: see `bending`.

        Along a beam of length L from a to b, seen from the point, the integral of r^2 is L (a a + a b + b b) / 3.

        Args:
            name: of the component.
            point: (3,) in the mount's frame.
        """

        moved_m = 0.0
        stress_pa = 0.0
        beams = [beam for _, beam in self.chains[name]]

        for beam in (*beams, self.beam(name, point)):
            a = beam.start - point
            b = beam.stop - point
            moved_m += beam.softness * float(a @ a + a @ b + b @ b) / 3
            far = max(np.linalg.norm(a), np.linalg.norm(b))
            stress_pa = max(stress_pa, beam.weakness * float(far))

        return moved_m, stress_pa

    def beam(self, name: str, stop: Array) -> Beam:
        """Return a component's part from where it is held to a point (3,) where it ends.

        It bends about the weaker axis of the section across it, that of the bounding box: I is w t^3 / 12. What fills a
        share s of its volume has s^2 of its stiffness, which is 5 % too much for a rod.
        """
        start = self.joints[name]
        shape = self._shapes[name]
        along = np.abs((stop - start) @ self._poses[name].rotation_matrix)

        size = shape.bounds[1]
        thin, wide = sorted(np.delete(size, along.argmax()))

        filled = shape.volume / float(np.prod(size))
        moment = filled**2 * float(second_moment(wide, thin, self.material))

        length = float(np.linalg.norm(stop - start))
        softness = length / (self.material.young_pa * moment)
        weakness = thin / 2 / moment if length > POINT_M else 0.0

        return Beam(start, stop, softness, weakness)


def second_moment(
    wide: Array | float, thin: Array | float, material: Material
) -> Array:
    """Compute the second moment of area of rectangles about their weaker axis, m^4, with walls and infill.

    Args:
        wide: their longer sides, metres.
        thin: their shorter sides.
        material: says what they are filled with.
    """
    walls = material.wall_mm / 500
    hollow = np.maximum(0.0, wide - walls) * np.maximum(0.0, thin - walls) ** 3
    hollow *= 1 - material.infill
    return np.asarray((wide * thin**3 - hollow) / 12)


def check_stiffness(tool: Tool, robot: Robot, material: Material) -> None:
    """Check how far a tool bends under a load at its ends, and of a real material whether it breaks.

    Its fixture is checked likewise, held at its mount's origin.

    Raises:
        DesignError: names the component, and says what would do.
    """
    weakness = find_weakness(tool, robot, material)
    if weakness is not None:
        raise DesignError.because(DesignReason.WEAK, weakness=str(weakness))


class Weakness(NamedTuple):
    """What bends too far or would break: by which figures, and what is allowed and would do."""

    found: str
    allowed: str

    def __str__(self) -> str:
        return self.found + self.allowed


def find_weakness(
    tool: Tool, robot: Robot, material: Material, larger: float = 1.0
) -> Weakness | None:
    """Find the first component of a tool or its fixture that bends too far or would break; None: none does.

    Args:
        tool: whose components are looked at.
        robot: the arm that holds it.
        material: that it is made of.
        larger: how many times as large tools are for which the loads are meant: this one's are as much smaller.

    Raises:
        DesignError: a component does not touch its parent.
    """
    beams = Beams(tool, check_contacts(tool, robot), material)
    found = _find_in_beams(beams, larger)
    if found is not None or tool.fixture is None:
        return found

    parts = tool.fixture.parts
    beams = Beams(parts, check_contacts(parts, None), material)
    return _find_in_beams(beams, larger, "fixture: ")


def _find_in_beams(beams: Beams, larger: float, whose: str = "") -> Weakness | None:
    """Find the first beam that bends too far or breaks; ``whose`` stands before what is said."""
    most_bend = MAX_BEND_M_N * larger**2
    load_n = MAX_LOAD_N / larger**3
    material = beams.material
    kind = f"of {material.name}"
    if material.density_kg_m3 is None:
        kind = "even of steel"
    most = material.strength_pa

    for name, (bend, stress) in beams.bending().items():
        if bend > most_bend:
            return Weakness(
                f"{whose}component {name!r} is not rigid: {kind}, 1 N would bend it by {1000 * bend:.3g} mm",
                f", from the mount to its end; at most {1000 * most_bend:.3g} mm are allowed: shorten or thicken what "
                "carries it",
            )

        load_pa = load_n * stress
        if most is not None and load_pa > most:
            return Weakness(
                f"{whose}component {name!r} would break: {kind}, {load_n:.3g} N at its end mean a stress of "
                f"{load_pa / 1e6:.3g} MPa in it or in what carries it",
                f"; at most {most / 1e6:g} MPa are allowed: shorten or thicken both",
            )

    return None
