"""Estimate how far a tool bends, from its components taken as beams, one after the other from the mount to a tip.

A force F across a beam moves its tip by F times the integral of r^2 / (E I), r being the distance from the tip (beam
theory of Euler and Bernoulli), and stresses the outside of a section of thickness t with F r t / 2 I. Torsion is left
out, and so is that parallel chains of components bear a load together. What is printed with walls and infill has the
second moment of area I of its walls, and of its inside times the infill.
Covered by `tests/core/designs/test_rules.py`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from core.design import Tool
from core.geometry import Array, Compound, Pose, Shape
from core.values.materials import Material

POINT_M = 1e-6  # what is shorter is no beam, and has no section
_CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T
Beam = tuple[Array, Array, float, float]  # its ends, its length over E I, and half its thickness over I


def corners(shape: Shape | Compound, pose: Pose) -> Array:
    """Compute the corners (8, 3) of a shape's bounding box."""
    middle, size = shape.bounds
    return pose.apply(_CORNERS * size + middle)


class Beams:
    """The components of a tool of ``material`` as beams.

    ``joints`` holds for each component the point (3,) where it touches its parent, in its mount's frame.
    """

    def __init__(self, tool: Tool, joints: Mapping[str, Array], material: Material) -> None:
        self.tool, self.joints, self.material = tool, joints, material
        self.placed = tool.placed()
        self._shapes = {component.name: component.shape for component in tool.components}
        # What carries each component, from the mount on: each carrier's name, and its beam up to the next joint.
        self.chains: dict[str, list[tuple[str, Beam]]] = {mount: [] for mount in tool.mounts}
        for component in tool.components:
            name, parent = component.name, component.parent
            own = [(parent, self.beam(parent, joints[name]))] if parent in self._shapes else []
            self.chains[name] = [*self.chains[parent], *own]

    def bending(self) -> dict[str, tuple[float, float]]:
        """Estimate for each component what a newton at its far end does: how far that moves, and the largest stress.

        The stress, in pascals, is that of the component or of what carries it.
        """
        bends = {}
        for component in self.tool.components:
            ends = corners(component.shape, self.placed[component.name][1])
            tip = ends[np.argmax(np.linalg.norm(ends - self.joints[component.name], axis=1))]
            bends[component.name] = self.bend(component.name, tip)
        return bends

    def bend(self, name: str, point: Array) -> tuple[float, float]:
        """Estimate what a newton at a point (3,) of a component does, in the mount's frame: see `bending`."""
        beams = [*(beam for _, beam in self.chains[name]), self.beam(name, point)]
        starts, stops, soft, weak = map(np.array, zip(*beams, strict=True))
        a, b = starts - point, stops - point
        far = np.linalg.norm([a, b], axis=2).max(axis=0)
        return float(soft @ (a * a + a * b + b * b).sum(axis=1)) / 3, float((weak * far).max())

    def beam(self, name: str, stop: Array) -> Beam:
        """Return a component's part from where it is held to ``stop`` (3,).

        It bends about the weaker axis of the section across it, that of the bounding box. What fills a share s of its
        volume has s^2 of its stiffness, which is 5 % too much for a rod.
        """
        start, shape, material = self.joints[name], self._shapes[name], self.material
        along = int(np.argmax(np.abs((stop - start) @ self.placed[name][1].rotation.as_matrix())))
        size = shape.bounds[1]
        thin, wide = sorted(np.delete(size, along))
        filled = shape.volume / float(np.prod(size))
        inner_thin, inner_wide = (max(0.0, side - material.wall_mm / 500) for side in (thin, wide))
        share = filled**2 * (1 - (1 - material.infill) * inner_wide * inner_thin**3 / (wide * thin**3))
        length = float(np.linalg.norm(stop - start))
        weak = 6 / (wide * thin**2 * share) if length > POINT_M else 0.0
        return start, stop, length / (material.young_pa * wide * thin**3 / 12 * share), weak
