"""Set up a funnel over what bodies must get into, where a task has a place for a fixture."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from core.design import RIGID_MOUNT, Fixture
from core.geometry import Array, Pose
from core.scene import Region
from plugins.vlms.offline.boxes import UP, Boxes, count_overlaps
from plugins.vlms.offline.scene_analysis import SceneAnalysis
from plugins.vlms.offline.scene_model import Solid
from plugins.vlms.offline.tool_building import ToolBuilder

_THICK_M = 0.004
_SLOPE = np.radians(35.0)  # bodies slide down it at a coefficient of friction of 0.5
_ABOVE_M = 0.001  # the rim that it stands on
_NARROWER_M = 0.001  # than the opening, at each side
_BELOW_M = 0.002  # bodies that are pushed over its edge
# From the edge of its place: a plate that leans reaches out by its thickness.
_INSIDE_M = 0.003
_LEAST_M = 0.02  # what it adds to each side of an opening
_SMALLER = 0.8  # than one for which there is no room
_STEP_M = 0.002  # in which an opening is measured
_DEPTH_M = 0.002  # below a rim, at which it is measured
_WIDEST_M = 0.2  # half of the widest opening
_SIDES = 4


def make_funnels(region: Region, analysis: SceneAnalysis) -> Iterator[Fixture]:
    """Yield funnels of four plates that stand on the rim of a fixed container, over its opening; the widest first.

    Args:
        region: where they may be.
        analysis: of the layout, with the goals.
    """
    for goal in analysis.goals:
        container = analysis.world.solids.get(goal.container or "")
        if container is None or not container.body.fixed or goal.place is None:
            continue

        x, y, _ = goal.place
        if x is None or y is None:
            continue

        bodies = [analysis.world.solids[name] for name in goal.bodies]
        middle = np.array([x, y, container.points[:, 2].max() + _ABOVE_M])
        half = _measure_opening(container, middle) - _NARROWER_M
        wider = _find_room(region, middle, half, bodies)
        while half > 0 and wider >= _LEAST_M:
            yield _build(middle, half, wider)
            wider *= _SMALLER


def _measure_opening(container: Solid, middle: Array) -> float:
    """Measure half of the side of the widest square that is free at a container's rim, metres.

    Args:
        container: open above.
        middle: of the opening, above the rim (3,).
    """
    place = Pose(middle - (_ABOVE_M + _DEPTH_M) * UP)
    free = 0.0
    for half in np.arange(_STEP_M, _WIDEST_M, _STEP_M).tolist():
        square = np.array([2 * half, 2 * half, _DEPTH_M / 2])
        if count_overlaps(Boxes.from_poses([(place, square)]), container.boxes):
            break
        free = half

    return free


def _find_room(
    region: Region, middle: Array, half: float, bodies: list[Solid]
) -> float:
    """Find how much wider than an opening a funnel may be, at each side, metres.

    Args:
        region: where it may be.
        middle: of the opening (3,).
        half: of its side, metres.
        bodies: which are to go over the funnel's edge, where they begin above the opening.
    """
    low = middle - np.array(region.low)
    high = np.array(region.high) - middle
    across = float(np.minimum(low, high)[:2].min()) - half - _INSIDE_M
    if low[2] < 0:
        return 0.0

    thick = _THICK_M / np.cos(_SLOPE)
    rise = high[2] - thick - _INSIDE_M
    feet = min(float(body.points[:, 2].min()) for body in bodies) - middle[2]
    if feet > 0:
        rise = min(rise, feet - thick - _BELOW_M)

    return float(min(across, rise / np.tan(_SLOPE)))


def _build(middle: Array, half: float, wider: float) -> Fixture:
    """Build plates that lean outward from the sides of a square, along the world's axes.

    Args:
        middle: of the square (3,).
        half: of its side, metres.
        wider: how far the plates reach outward, metres.
    """
    builder = ToolBuilder(gripper=False)
    length = wider / float(np.cos(_SLOPE))
    width = 2 * (half + wider)

    # The middle of a plate whose upper face begins at the square, and whose lowest edge is level with it.
    out = half + (wider + _THICK_M * np.sin(_SLOPE)) / 2
    up = (wider * np.tan(_SLOPE) + _THICK_M * np.cos(_SLOPE)) / 2
    leaning = Pose.xyz_rpy((out, 0.0, up), (0.0, -_SLOPE, 0.0))

    parent = RIGID_MOUNT  # and then the plate before, which it meets at a corner
    for number in range(_SIDES):
        turn = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, number * np.pi / 2))
        name = f"plate_{number + 1}"
        parent = builder.add_box(
            name, parent, turn @ leaning, (length, width, _THICK_M)
        )

    return Fixture(builder.build("funnel", "four plates over an opening"), Pose(middle))
