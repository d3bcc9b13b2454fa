"""A layout as the designer sees it: its bodies, where the end-effector starts, and where the arm works with ease."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy.spatial import ConvexHull

from core.design import Fixture, Tool
from core.geometry import Array, Cylinder, Mesh, Pose, Shape
from core.interfaces import Brief
from core.scene import Body, Scene
from plugins.vlms.offline.boxes import Boxes
from plugins.vlms.offline.workspace import compute_workspace

T = TypeVar("T")

_THINNEST_M = 1e-4  # of a box around a flat shape
HALF_TURN = Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, np.pi, 0.0))
"""About y, after which what was below is above."""

_ON_M = 0.005  # above what a body stands on, its foot at most
_OCTAGON = 4  # boxes, of which a cylinder's is made


@dataclass(frozen=True, eq=False)
class Solid:
    """A body with collision shapes, where it is in a layout; a soft body as it is at the start.

    Attributes:
        points: the corners of its shapes in the world, (V, 3).
        boxes: around its shapes, in the world.
        body: as the scene has it.
    """

    points: Array
    boxes: Boxes
    body: Body

    @property
    def position(self) -> Array:
        """The origin of the body's frame in the world, (3,)."""
        return self.body.pose.position

    def moved_by(self, by: Pose) -> Solid:
        """Return the body moved by a pose in the world."""
        body = replace(self.body, pose=by @ self.body.pose)
        boxes = self.boxes.moved_to(by.position[None], by.rotation_matrix[None])
        return Solid(by.apply(self.points), boxes, body)

    def stands_on(self, below: Solid) -> bool:
        """Report whether its middle is over another body, and its foot on top of it or lower."""
        lower = below.points.min(axis=0)
        upper = below.points.max(axis=0)
        foot = self.points.min(axis=0)
        middle = (foot + self.points.max(axis=0)) / 2
        over = (middle > lower)[:2].all() and (middle < upper)[:2].all()
        return bool(over and lower[2] < middle[2] and foot[2] < upper[2] + _ON_M)

    @classmethod
    def from_body(cls, body: Body) -> Solid:
        """Make the corners and boxes of a body, by its collision shapes, or what is drawn of a body without any."""
        points = []
        placed = []
        for part in body.collisions or body.visuals:
            pose = body.pose @ part.pose
            points.append(pose.apply(part.shape.to_trimesh().vertices))
            for around, size in _boxes_around(part.shape):
                placed.append((pose @ around, np.maximum(size, _THINNEST_M)))

        return cls(np.concatenate(points), Boxes.from_poses(placed), body)


def _boxes_around(shape: Shape) -> list[tuple[Pose, Array]]:
    """Compute poses and full sides (3,) of upright boxes around a shape, in its frame.

    A cylinder gets four, which form an octagon; a mesh gets the smallest one.

    Returns:
        One box, or those that cover a cylinder together.
    """
    if isinstance(shape, Cylinder):
        across = 2 * shape.radius
        size = np.array([across, across * np.tan(np.pi / 8), shape.length])
        return [(_turned(k * np.pi / 4), size) for k in range(_OCTAGON)]

    vertices = np.asarray(shape.to_trimesh().vertices)
    turns = [Pose()]
    if isinstance(shape, Mesh):  # one side of the smallest box is along an edge
        flat = vertices[:, :2]
        edges = np.diff(flat[ConvexHull(flat).simplices], axis=1)[:, 0]
        turns += [_turned(yaw) for yaw in np.arctan2(edges[:, 1], edges[:, 0])]

    boxes = [_box_around(vertices, turn) for turn in turns]
    return [min(boxes, key=lambda box: np.prod(box[1]))]


def _box_around(vertices: Array, turn: Pose) -> tuple[Pose, Array]:
    """Compute the box along the axes of ``turn``.

    Args:
        vertices: of the shape in its own frame, (V, 3).
        turn: which the box has in that frame.

    Returns:
        The box's pose in the shape's frame, and its full sides (3,).
    """
    inside = turn.inverse().apply(vertices)
    lower = inside.min(axis=0)
    upper = inside.max(axis=0)
    return turn @ Pose((lower + upper) / 2), upper - lower


def _turned(yaw: float) -> Pose:
    """Return the pose of a frame that is turned about z, radians."""
    return Pose.xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw))


def _move_bodies(scene: Scene, by: Pose) -> Scene:
    """Return the scene with all bodies moved by a pose in the world."""
    moved = [replace(body, pose=by @ body.pose) for body in scene.bodies]
    return replace(scene, bodies=tuple(moved))


class SceneModel:
    """The bodies of a layout that have collision shapes, and the arm's workspace.

    Attributes:
        scene: of the layout.
        solids: bodies with collision shapes, and soft ones, by name.
        boxes: those of all solids.
        home: where the end-effector starts.
        workspace: of the arm.
        turned: whether everything but the robot was turned about it.
        upright: the half turn by which bodies were moved, so that gravity, which draws up, draws down; None: they were
            not.
    """

    def __init__(
        self,
        brief: Brief,
        turn: Pose | None = None,
        upright: Pose | None = None,
        fixture: Fixture | None = None,
    ) -> None:
        """Read a brief's layout, with a ``fixture`` that designs add to it.

        With a ``turn`` everything but the robot is moved by it, so that the world's axes are those of what the bodies
        are taken by. By ``upright`` the bodies alone are moved.
        """
        furniture = Tool(fixture=fixture)
        scene = brief.task.scene(brief.scene_seed).furnished(furniture)
        self.home = brief.task.home
        self.workspace = compute_workspace(brief.task.robot)
        self.turned = turn is not None
        self.upright = upright

        if turn is not None:
            self.home = turn @ self.home
            scene = _move_bodies(scene, turn)
        if upright is not None:
            scene = _move_bodies(scene, upright)

        self._take(scene)

    def after(self, scene: Scene) -> SceneModel:
        """Return the same with the scene as it is later, when bodies were moved.

        Args:
            scene: with the same bodies.
        """
        later = copy(self)
        later._take(scene)
        return later

    def _take(self, scene: Scene) -> None:
        """Take the bodies of a scene for those of the layout."""
        self.scene = scene
        self.solids: dict[str, Solid] = {}
        for body in scene.bodies:
            if body.collides:
                self.solids[body.name] = Solid.from_body(body)

        self.boxes = Boxes.concatenate(solid.boxes for solid in self.solids.values())
        self._found: dict[Hashable, object] = {}

    @property
    def draws_up(self) -> bool:
        """Whether gravity draws up in the world."""
        return self.scene.gravity[2] > 0.0

    def find_upright(self) -> Pose | None:
        """Find the half turn about the robot after which gravity draws down; None: it does not draw up now.

        What floats to a ceiling lies on it, seen so, and is lifted by what lowers it.
        """
        if not self.draws_up:
            return None

        base = Pose(self.workspace.base)
        return base @ HALF_TURN @ base.inverse()

    @property
    def clearance_at_home(self) -> float:
        """The height of the end-effector's home over the highest body below it, metres."""
        tops = self.boxes.bounds[1][:, 2]
        home = self.home.position[2]
        return float(home - tops[tops < home].max(initial=-np.inf))

    def find_enclosing(self, solids: Sequence[Solid]) -> list[Solid]:
        """Find the bodies, fixed or loose, whose bounds enclose the positions of all of these.

        Args:
            solids: of which the origins count, not the shapes.
        """
        positions = np.array([solid.position for solid in solids])
        enclosing = []
        for other in self.solids.values():
            above = positions > other.points.min(axis=0)
            below = positions < other.points.max(axis=0)
            if (above & below).all() and other not in solids:
                enclosing.append(other)

        return enclosing

    def find_container(self, solids: Sequence[Solid]) -> str | None:
        """Name the smallest body that encloses the positions of all of these; None: there is none."""
        enclosing = self.find_enclosing(solids)
        if not enclosing:
            return None

        # By the volume of the box along the world's axes around a body.
        smallest = min(enclosing, key=lambda s: np.ptp(s.points, axis=0).prod())
        return smallest.body.name

    def find_once(self, key: Hashable, find: Callable[[], T]) -> T:
        """Return what ``find`` found when this key was first asked for: searches by rays take long.

        Args:
            key: names what is searched for, in which bodies.
            find: makes the search.
        """
        if key not in self._found:
            self._found[key] = find()

        return self._found[key]  # type: ignore[return-value]  # a key is of one search
