"""What stands in a task's world, what is wanted of it, and what a reward may look at.

Nothing here knows a physics engine: a simulator reads a `Scene`, and gives `State`s back.
World frame: x forward from the arm's base, y left, z up; metres, kilograms, radians.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from core.geometry import Array, Box, Cylinder, Mesh, Pose, Shape, Sphere, Vector, frozen_array

Color = tuple[float, float, float, float]


@dataclass(frozen=True)
class Geom:
    """One shape of a body: where it sits in the body's frame, and its colour (red, green, blue, opacity; 0..1)."""

    shape: Shape
    pose: Pose = field(default_factory=Pose)
    color: Color = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class Inertia:
    """Mass, the frame of the principal axes at the centre of mass (in the body's frame), and the principal moments
    (3,).
    """

    mass: float
    frame: Pose
    moments: Array


@dataclass(frozen=True)
class Body:
    """A rigid body, free to move, or fixed where it stands if its mass is 0.

    ``visuals`` are seen, ``collisions`` are felt (a `Mesh` there means its convex hull; hollow things are several
    convex parts; no collisions: a mark that nothing touches). The friction coefficient of a contact is the geometric
    mean of the two bodies' ``friction``, in every engine. ``rolling_friction`` is the torsional arm in metres. The
    restitution of a contact is the product of the two bodies'; the arm and its tools have none.

    Raises:
        ValueError: a negative mass, or a free body without collision parts.
    """

    name: str
    pose: Pose
    mass: float
    visuals: tuple[Geom, ...]
    collisions: tuple[Geom, ...]
    friction: float = 0.5
    rolling_friction: float = 0.0
    restitution: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise ValueError(f"body {self.name!r}: the mass must be 0 (fixed) or positive, got {self.mass}")
        if self.mass > 0 and not self.collisions:
            raise ValueError(f"body {self.name!r}: a body that can move needs collision parts")

    @classmethod
    def of(
        cls,
        name: str,
        shape: Shape,
        position: Vector,
        *,
        mass: float,
        color: Color,
        rpy: Vector = (0.0, 0.0, 0.0),
        friction: float = 0.5,
        rolling_friction: float = 0.0,
    ) -> Body:
        """A body of one shape that collides as it looks."""
        part = (Geom(shape, color=color),)
        return cls(name, Pose.xyz_rpy(position, rpy), mass, part, part, friction, rolling_friction)

    @classmethod
    def mark(cls, name: str, position: Vector, radius: float, color: Color) -> Body:
        """A flat round mark that is seen and not felt."""
        disc = Geom(Cylinder(radius, 0.001), Pose(np.array([0.0, 0.0, 0.0005])), color)
        return cls(name, Pose(np.asarray(position, dtype=np.float64)), 0.0, (disc,), ())

    @property
    def fixed(self) -> bool:
        return self.mass == 0

    def inertia(self) -> Inertia:
        """Of the collision parts together, at one density throughout."""
        meshes = []
        for part in self.collisions:
            mesh = part.shape.to_trimesh()
            mesh = mesh.convex_hull if isinstance(part.shape, Mesh) else mesh
            meshes.append(mesh.apply_transform(part.pose.matrix))
        density = self.mass / sum(mesh.volume for mesh in meshes)
        center = sum(mesh.volume * mesh.center_mass for mesh in meshes) * density / self.mass
        tensor = np.zeros((3, 3))
        for mesh in meshes:
            arm = mesh.center_mass - center
            shift = np.dot(arm, arm) * np.eye(3) - np.outer(arm, arm)
            tensor += density * (mesh.moment_inertia + mesh.volume * shift)
        if np.abs(tensor - np.diag(np.diag(tensor))).max() < 1e-9 * np.trace(tensor):
            return Inertia(self.mass, Pose(center), frozen_array(np.diag(tensor)))
        moments, axes = np.linalg.eigh(tensor)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = axes, center
        return Inertia(self.mass, Pose.from_matrix(matrix), frozen_array(moments))


@dataclass(frozen=True)
class Scene:
    """Everything in the world but the robot.

    Raises:
        ValueError: two bodies of one name.
    """

    bodies: tuple[Body, ...]

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two bodies of one name in the scene: {', '.join(twice)}")

    def __getitem__(self, name: str) -> Body:
        for body in self.bodies:
            if body.name == name:
                return body
        raise KeyError(f"no body {name!r} in the scene; there are: {', '.join(body.name for body in self.bodies)}")

    @property
    def free(self) -> tuple[Body, ...]:
        """The bodies that can move, in order: a `State` speaks of these."""
        return tuple(body for body in self.bodies if not body.fixed)

    def state(self) -> State:
        """The free bodies as they are placed, at rest."""
        free = self.free
        return State(
            tuple(body.name for body in free),
            np.array([body.pose.position for body in free]).reshape(len(free), 3),
            np.array([body.pose.quaternion for body in free]).reshape(len(free), 4),
            np.zeros((len(free), 3)),
            np.zeros((len(free), 3)),
        )


@dataclass(frozen=True)
class State:
    """Where the free bodies are and how they move, in one world or in many.

    Positions (..., B, 3) are those of the bodies' frames in the world, quaternions (..., B, 4), velocities (..., B,
    3) in m/s and rad/s, world axes. The leading axes, if any, are worlds or instants.
    """

    names: tuple[str, ...]
    positions: Array
    quaternions: Array
    linear_velocities: Array
    angular_velocities: Array

    def _number(self, name: str) -> int:
        if name not in self.names:
            raise KeyError(f"no free body {name!r} in the state; there are: {', '.join(self.names)}")
        return self.names.index(name)

    def position(self, name: str) -> Array:
        """Of one body, (..., 3)."""
        return self.positions[..., self._number(name), :]

    def quaternion(self, name: str) -> Array:
        """Of one body, (..., 4)."""
        return self.quaternions[..., self._number(name), :]

    def linear_velocity(self, name: str) -> Array:
        """Of one body, (..., 3)."""
        return self.linear_velocities[..., self._number(name), :]

    def pose(self, name: str) -> Pose:
        """Of one body in one world."""
        return Pose(self.position(name), self.quaternion(name))

    def __getitem__(self, index: int) -> State:
        """One world (or instant) of many."""
        return State(
            self.names,
            self.positions[index],
            self.quaternions[index],
            self.linear_velocities[index],
            self.angular_velocities[index],
        )

    def each(self) -> Iterator[State]:
        """The worlds (or instants) of the first axis, one by one."""
        return (self[i] for i in range(len(self.positions)))

    @staticmethod
    def stack(states: Sequence[State]) -> State:
        """Many states as one with a new leading axis.

        Raises:
            ValueError: no states, or states of different bodies.
        """
        if not states or any(state.names != states[0].names for state in states):
            raise ValueError("only states of the same bodies can be stacked, and at least one is needed")
        return State(
            states[0].names,
            np.stack([state.positions for state in states]),
            np.stack([state.quaternions for state in states]),
            np.stack([state.linear_velocities for state in states]),
            np.stack([state.angular_velocities for state in states]),
        )


@dataclass(frozen=True)
class Goal:
    """What a task wants, told so that a program can read it: which bodies to move, and where to.

    Either ``place``, where ``bodies`` are to end (metres, world frame; None: that coordinate is free), within
    ``tolerance`` metres; or ``away``, how far from where it started each is to end, in whatever direction. With ``any``
    one of the bodies is enough. ``keep`` are bodies to leave as they are. The reward is what counts; this is a hint
    for designers that can't read prose.

    Raises:
        ValueError: neither or both of ``place`` and ``away``.
    """

    bodies: tuple[str, ...]
    place: tuple[float | None, float | None, float | None] | None = None
    away: float | None = None
    tolerance: float = 0.0
    any: bool = False
    keep: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if (self.place is None) == (self.away is None):
            raise ValueError("a goal has either a place or a distance away from the start")


@dataclass(frozen=True)
class Camera:
    """A camera at ``position`` that looks at ``target``, world z up in the picture; vertical field of view in
    degrees.
    """

    position: tuple[float, float, float] = (1.55, -1.15, 1.15)
    target: tuple[float, float, float] = (0.55, 0.0, 0.15)
    fov_deg: float = 60.0


def table() -> Body:
    """The table of most tasks: top face at z = 0, x from -0.15 to 1.35, y from -0.5 to 0.5, on four legs."""
    wood: Color = (0.76, 0.60, 0.42, 1.0)
    leg: Color = (0.35, 0.28, 0.22, 1.0)
    top = Geom(Box((1.5, 1.0, 0.04)), Pose(np.array([0.6, 0.0, -0.02])), wood)
    legs = tuple(
        Geom(Box((0.05, 0.05, 0.585)), Pose(np.array([x, y, -0.3325])), leg) for x in (-0.1, 1.3) for y in (-0.45, 0.45)
    )
    return Body("table", Pose(), 0.0, (top, *legs), (top, *legs))


def floor(height: float = -0.625, friction: float = 0.5) -> Body:
    """A floor whose upper face is at z = ``height``."""
    slab = Geom(Box((6.0, 6.0, 0.1)), Pose(np.array([0.0, 0.0, height - 0.05])), (0.86, 0.87, 0.88, 1.0))
    return Body("floor", Pose(), 0.0, (slab,), (slab,), friction)


__all__ = [
    "Body",
    "Box",
    "Camera",
    "Color",
    "Cylinder",
    "Geom",
    "Goal",
    "Inertia",
    "Mesh",
    "Pose",
    "Scene",
    "Sphere",
    "State",
    "floor",
    "table",
]
