"""Perturb scenes and tools at random, the same for the same number."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from core.design import Component, Tool
from core.geometry import Pose
from core.scene import Scene
from plugins.fitness.perturbation_range import PerturbationRange


@dataclass(frozen=True)
class Perturbation:
    """A change of scenes (`core.trial.Change`): the perturbation of a number, drawn from ranges."""

    ranges: PerturbationRange
    number: int

    def __call__(self, scene: Scene) -> Scene:
        # Imported here, since each command's start asks for the settings above.
        from plugins.fitness.scattering import perturb

        return perturb(scene, self.ranges, self.number)

    def perturb_tool(self, tool: Tool) -> Tool:
        """Return the tool a little larger or smaller about its mount, rougher or smoother."""
        if self.ranges.size == 0:
            return tool

        rng = np.random.default_rng([self.number, 2])
        larger, rougher = rng.uniform(-1, 1, 2).tolist()
        scale = 1 + self.ranges.size * larger
        components = [_scale(component, scale) for component in tool.components]
        friction = tool.friction * (1 + self.ranges.friction * rougher)
        return replace(tool, components=tuple(components), friction=friction)


def _scale(component: Component, scale: float) -> Component:
    """Return a component with all lengths scaled; its mass stays."""
    pose = component.pose
    joint = component.joint
    if joint is not None:
        x, y, z = joint.origin
        joint = replace(joint, origin=(scale * x, scale * y, scale * z))

    return replace(
        component,
        pose=Pose(scale * pose.position, pose.quaternion),
        shape=component.shape.scaled(scale),
        joint=joint,
    )
