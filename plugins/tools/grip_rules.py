"""Check what a tool grips with: that a flat face bears each patch, and that an engine can follow it."""

from __future__ import annotations

import numpy as np

from core.design import Component, DesignError, Tool
from core.geometry import Pose, Sphere
from core.interfaces import Robot
from core.robot.solids import Solid, closest, solid_geometry, solids_of
from core.values.materials import Material
from plugins.tools.refusals import ToolReason

MAX_GRIPS = 16
FLAT_M = 2e-4  # by which a face may be off a plane
_POINT_M = 1e-4  # radius of the ball by which that is measured


def check_grips(tool: Tool, robot: Robot, material: Material) -> None:
    """Check the components of a tool that grip.

    Raises:
        DesignError: says which can't be, and why.
    """
    if tool.fixture is not None and tool.fixture.parts.gripping:
        raise DesignError.because(ToolReason.GRIP_OF_FIXTURE)

    gripping = tool.gripping
    if not gripping:
        return
    if tool.gripper:
        raise DesignError.because(ToolReason.GRIP_OF_FINGERS)
    if len(gripping) > MAX_GRIPS:
        raise DesignError.because(
            ToolReason.GRIP_COUNT, count=len(gripping), most=MAX_GRIPS
        )

    for component in gripping:
        _check_grip(component, tool)


def _check_grip(component: Component, tool: Tool) -> None:
    grip = component.grips
    assert grip is not None
    bearer, _ = tool.borne[component.name]
    if bearer not in tool.mounts:
        raise DesignError.because(
            ToolReason.GRIP_MOVES, component=component.name, bearer=bearer
        )

    if not grip.fits(component.shape):
        raise DesignError.because(
            ToolReason.GRIP_AREA,
            component=component.name,
            face=grip.face,
            area_mm2=grip.area_mm2,
            across_mm=2000 * grip.radius_m,
        )

    solids = solids_of(component.name, component.shape, Pose())
    probe = solid_geometry(Sphere(_POINT_M))
    place = grip.place(component.shape)
    gaps = [
        closest([Solid("", probe, Pose(point))], solids)[0] + _POINT_M
        for point in place.apply(0.99 * grip.points)
    ]
    off = float(np.abs(gaps).max())
    if off > FLAT_M:
        raise DesignError.because(
            ToolReason.GRIP_FLAT,
            component=component.name,
            face=grip.face,
            off_mm=1000 * off,
        )
