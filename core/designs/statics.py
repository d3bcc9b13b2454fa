"""Check that an arm can carry a tool, and estimate how far a tool bends, as beams.

The beams follow each other from the mount to a tip. A force F across a beam moves its tip by F times the integral of
r^2 / (E I), r being the distance from the tip (beam theory of Euler and Bernoulli), and stresses the outside of a
section of thickness t with F r t / 2 I. Torsion is left out, and so is that parallel chains of components bear a load
together. What is printed with walls and infill has the second moment of area I of its walls, and of its inside times
the infill.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import trimesh

from core.design import DesignError, Tool
from core.geometry import Array, Compound, Pose, Shape, mass_properties
from core.interfaces import Robot
from core.robot.kinematics import arm_of, open_mounts
from core.values.materials import Material

POINT_M = 1e-6  # what is shorter is no beam, and has no section
GRAVITY = 9.81  # m/s^2


def corners(shape: Shape | Compound, pose: Pose) -> Array:
    """Compute the corners of a shape's bounding box.

    Args:
        shape: at a pose.
        pose: in some frame.

    Returns:
        Corners (8, 3) in this frame.
    """
    middle, size = shape.bounds
    box = [middle - size / 2, middle + size / 2]

    return pose.apply(trimesh.bounds.corners(box))


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
            ends = corners(component.shape, self._poses[name])
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
        along = np.abs((stop - start) @ self._poses[name].rotation.as_matrix())

        size = shape.bounds[1]
        thin, wide = sorted(np.delete(size, along.argmax()))

        walls = self.material.wall_mm / 500
        hollow = max(0.0, wide - walls) * max(0.0, thin - walls) ** 3
        hollow *= 1 - self.material.infill

        filled = shape.volume / float(np.prod(size))
        second_moment = filled**2 * (wide * thin**3 - hollow) / 12

        length = float(np.linalg.norm(stop - start))
        softness = length / (self.material.young_pa * second_moment)
        weakness = thin / 2 / second_moment if length > POINT_M else 0.0

        return Beam(start, stop, softness, weakness)


def moment_limit(robot: Robot) -> float:
    """Return the largest moment about the mount that the wrist bears in any posture, N m.

    It is the smallest effort limit of the last three joints, of which one is level in some posture.
    """
    return float(arm_of(robot).effort_limits[-3:].min())


def flange_moment(tool: Tool, robot: Robot) -> float:
    """Compute the largest moment of a tool's weight about the mount, N m: with its centre of mass level with it."""
    mounts = open_mounts(robot, tool.gripper)
    placed = tool.placed()

    moments = np.zeros(3)  # of mass
    for component in tool.components:
        mount, pose = placed[component.name]
        center, _ = mass_properties(component.shape, component.mass)
        moments += component.mass * (mounts[mount] @ pose).apply(center)

    return GRAVITY * float(np.linalg.norm(moments))


def mass_limit(robot: Robot, material: Material) -> tuple[float, str]:
    """Return how much a tool may weigh.

    Args:
        robot: what carries it.
        material: may have a budget.

    Returns:
        The mass, kg, and the reason in words.
    """
    budget_kg = math.inf if material.most_g is None else material.most_g / 1000
    if budget_kg < robot.payload_kg:
        return budget_kg, f"the budget of material is {budget_kg:g} kg"

    return robot.payload_kg, f"the arm carries at most {robot.payload_kg:g} kg"


def check_weight(tool: Tool, robot: Robot, material: Material) -> None:
    """Refuse a tool that is too heavy for an arm or its material's budget, or of a real one too far out for its weight.

    Args:
        tool: with the masses that it has.
        robot: what carries it.
        material: what it is made of.

    Raises:
        DesignError: with the figures, and the component that weighs most.
    """
    heaviest = max(tool.components, key=lambda component: component.mass)
    mend = f"component {heaviest.name!r} weighs most, {heaviest.mass:.3g} kg: make parts thinner, shorter or fewer"
    most_kg, why = mass_limit(robot, material)

    if tool.mass > most_kg:
        raise DesignError(f"the tool weighs {tool.mass:.3g} kg; {why}; {mend}")
    if material.density_kg_m3 is None:
        return

    moment = flange_moment(tool, robot)
    most = moment_limit(robot)
    if moment > most:
        raise DesignError(
            f"the tool, of {tool.mass:.3g} kg, turns the wrist with {moment:.3g} N m, its centre of mass being "
            f"{moment / GRAVITY / tool.mass:.3g} m from the mount; at most {most:g} N m are allowed; {mend}, or bring "
            "heavy parts closer to the mount"
        )
