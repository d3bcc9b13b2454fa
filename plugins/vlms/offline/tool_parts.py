"""Tools of any origin: where their boxes are, what is their head, and which part is for one of several tasks."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from core.design import GRIPPER_MOUNTS, RIGID_MOUNT, Component, Tool
from core.geometry import Array, Pose
from core.interfaces import Task
from plugins.vlms.offline.boxes import Boxes, heading_axes
from plugins.vlms.offline.chance import draw_head_turn
from plugins.vlms.offline.heads import FINGER_OPEN, Head, Primitive
from plugins.vlms.offline.scene_model import HALF_TURN
from plugins.vlms.offline.subgoals import Subgoal

_TURN_RAD = 0.1  # how wrong the guess of a working side is
_BACK_WALL_M = 0.01  # of what encloses: what it encloses is before it
_PAD_DEPTH_M = 0.01  # of pads, and of bare fingers: half of their width
_MOST_NAME = 24  # characters of a task's name in that of a component
_LOW_M = 0.015  # boxes this close to a tool's lowest point do its work
_FINGER_Z = -0.0584  # the fingers' frames below the tool mount, with the hand on
_BARE_FINGERTIP = np.array([0.0, 0.0, -0.11])  # in the frame of the tool mount
FINGERTIP = np.array([0.0, FINGER_OPEN + 0.0076, -0.105])
"""The right fingertip, open, in the frame of the tool mount; the left one's y is negative."""


def _make_hand() -> Boxes:
    """Make the boxes of a palm and two fingers, as large as those of the Panda."""
    palm = Pose(np.array([0.0, 0.0, -0.033]))
    placed = [(palm, np.array([0.064, 0.206, 0.066]))]

    for side in (-1, 1):
        finger = Pose(np.array([0.0, side * FINGERTIP[1], -0.086]))
        placed.append((finger, np.array([0.022, 0.016, 0.054])))

    return Boxes.from_poses(placed)


HAND = _make_hand()
"""The hand with its fingers open, in the frame of the tool mount."""

MOUNTS: dict[str, Pose] = {
    RIGID_MOUNT: Pose(),
    GRIPPER_MOUNTS[0]: Pose.xyz_rpy((0.0, -FINGER_OPEN, _FINGER_Z), (np.pi, 0.0, 0.0)),
    GRIPPER_MOUNTS[1]: Pose.xyz_rpy((0.0, FINGER_OPEN, _FINGER_Z), (np.pi, 0.0, 0.0)),
}
"""The mounts in the frame of the tool mount, with the fingers open."""


@dataclass(frozen=True, eq=False)
class PlacedHead:
    """A head, and its pose in the frame of the tool mount.

    Attributes:
        head: of a tool, as it was drawn or as it is guessed.
        pose: of the head's frame.
    """

    head: Head
    pose: Pose


def tool_boxes(tool: Tool) -> Boxes:
    """Place the components in the frame of the tool mount, with the fingers open.

    Args:
        tool: of any origin; of shapes that are not boxes, the bounds count.
    """
    placed = tool.placed()

    boxes = []
    for component in tool.components:
        mount, pose = placed[component.name]
        boxes.append((MOUNTS[mount] @ pose, component.shape.bounds[1]))

    return Boxes.from_poses(boxes)


def lowest_corners(tool: Tool, turn: Pose | None = None) -> Array:
    """Find the corners (V, 3) of a tool's lowest boxes, which do its work.

    Args:
        tool: without components the fingertip of the bare hand counts.
        turn: of the tool about its mount; None: as it hangs.

    Returns:
        In the frame of the tool mount, turned so.
    """
    if not tool.components:
        return _BARE_FINGERTIP[None]

    boxes = tool_boxes(tool)
    if turn is not None:
        boxes = boxes.moved_to(turn.position[None], turn.rotation_matrix[None])

    bottoms = boxes.bounds[0][:, 2]
    low = boxes[bottoms < bottoms.min() + _LOW_M]

    signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), axis=-1)
    offsets = signs.reshape(-1, 3) * low.halves[:, None]
    turned = np.einsum("nij,ncj->nci", low.axes, offsets)

    return np.asarray(low.centers[:, None] + turned).reshape(-1, 3)


def lowest_middle(tool: Tool) -> Array:
    """Find the middle (3,) of the boxes that do a tool's work, at their lowest height.

    Args:
        tool: without components the fingertip of the bare hand counts.
    """
    corners = lowest_corners(tool)
    lower = corners.min(axis=0)
    middle = (lower + corners.max(axis=0)) / 2
    middle[2] = lower[2]

    return np.asarray(middle)


def task_suffix(task: Task) -> str:
    """Return the end of the names of components that are for one of several tasks.

    Args:
        task: whose name may have characters that a component's can't.
    """
    return re.sub(r"[^\w.-]", "_", task.name, flags=re.ASCII)[:_MOST_NAME]


def find_part(tool: Tool, task: Task) -> Tool:
    """Return the part of a tool that is for one of several tasks; it may have no components.

    Args:
        tool: with components for several tasks, or for one.
        task: one of them.
    """
    names: set[str] = set()

    components = []
    for component in tool.components:  # parents go before their children
        named = component.name.endswith(f"_{task_suffix(task)}")
        if named or component.parent in names:
            names.add(component.name)
            components.append(component)

    return replace(tool, components=tuple(components))


def working_part(tool: Tool, task: Task) -> Tool:
    """Return what of a tool does a task: its part for it, or all of it where there is none.

    Args:
        tool: with parts for several tasks, or for one.
        task: one of them.
    """
    part = find_part(tool, task)
    return part if part.components else tool


def rename_components(tool: Tool, suffix: str) -> tuple[Component, ...]:
    """Return the components of a tool with longer names, so that they differ from those of another tool.

    Args:
        tool: of any origin.
        suffix: of each name, after an underscore.
    """
    names = {component.name for component in tool.components}

    components = []
    for component in tool.components:
        parent = component.parent
        if parent in names:
            parent = f"{parent}_{suffix}"

        named = replace(component, name=f"{component.name}_{suffix}", parent=parent)
        components.append(named)

    return tuple(components)


def guess_head(
    tool: Tool,
    subgoal: Subgoal,
    rng: Generator,
) -> PlacedHead:
    """Take a tool's lowest boxes for its head; those on two fingers are pads, which close.

    The side that works is guessed at random, and so is the face: in front as a blade's, or at the back as a cage's.

    Args:
        tool: of any origin.
        subgoal: what is to be moved.
        rng: random numbers.
    """
    turn = draw_head_turn(rng) + rng.normal(0.0, _TURN_RAD)
    encloses = rng.random() < 0.5

    if tool.gripper and not tool.components:
        hand = Head("hand", "clamp", (), np.zeros(3), _PAD_DEPTH_M, 2 * FINGER_OPEN)
        return PlacedHead(hand, Pose(_BARE_FINGERTIP))

    heading = subgoal.heading - turn
    ahead, side = (axis[:2] for axis in heading_axes(heading))

    # Where gravity draws up, the highest boxes are those that do the work.
    over = HALF_TURN if subgoal.model.draws_up else None
    pads = _guess_pads(tool)
    if pads is not None and over is None:
        return pads

    corners = lowest_corners(tool, over)
    along = corners[:, :2] @ ahead
    across = corners[:, :2] @ side

    depth = 0.0

    if subgoal.rises or encloses:
        depth = max(0.0, np.ptp(along) - _BACK_WALL_M)

    middle = (across.min() + across.max()) / 2 * side
    x, y = (along.max() - depth) * ahead + middle
    primitive: Primitive = "scoop" if subgoal.rises else "push"

    width = np.ptp(across)
    head = Head("foot", primitive, (), np.zeros(3), depth, width)
    lowest = corners[:, 2].min()

    pose = Pose.xyz_rpy((x, y, lowest), (0.0, 0.0, heading))
    if over is not None:
        pose = over.inverse() @ pose

    return PlacedHead(head, pose)


def _guess_pads(tool: Tool) -> PlacedHead | None:
    """Take the lowest boxes on a tool's two fingers for pads; None: they are on one finger only.

    Args:
        tool: of any origin.
    """
    if not (tool.gripper and tool.components):
        return None

    placed = tool.placed()
    lower, upper = tool_boxes(tool).bounds
    mounts = [placed[component.name][0] for component in tool.components]
    is_left = np.array([mount == GRIPPER_MOUNTS[0] for mount in mounts])
    low = lower[:, 2] < lower[:, 2].min() + _LOW_M

    left = low & is_left
    right = low & ~is_left
    if not (left.any() and right.any()):
        return None

    left_face = upper[left, 1].max()
    right_face = lower[right, 1].min()
    middle = (lower[low, 0].min() + upper[low, 0].max()) / 2
    height = upper[low, 2].max() - lower[low, 2].min()

    place = np.array([middle, (left_face + right_face) / 2, lower[low, 2].min()])
    attachment = np.array([0.0, 0.0, height])
    width = right_face - left_face
    head = Head("pads", "clamp", (), attachment, _PAD_DEPTH_M, max(0.0, width))
    return PlacedHead(head, Pose(place))
