"""Describe a task's scene.

Nothing here depends on a physics engine: a simulator reads a `Scene` and returns states (`core.values.states`).
World frame: x forward from the arm's base, y left, z up; metres, kilograms, radians.
"""

# ruff: noqa: I001 - names that are handed on (`X as X`) stand together: a task needs one import

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import chain
from typing import TypedDict

import numpy as np

from core.errors import WrongPart, refuse, unknown
from core.geometry import (
    Array,
    Box as Box,
    Color as Color,
    Cylinder as Cylinder,
    Mesh as Mesh,
    Pose as Pose,
    Shape,
    Sphere as Sphere,
    Vector,
)
from core.values.bonds import Bond as Bond
from core.values.joints import (
    Drive as Drive,
    Joint as Joint,
    Latch as Latch,
    PlacedJoint,
    Placement,
)
from core.values.margins import Margin as Margin
from core.values.softs import (
    MAX_NODES,
    Cloth as Cloth,
    Elastic as Elastic,
    Filling as Filling,
    Form as Form,
    Rope as Rope,
)
from core.values.states import State as State
from core.values.tools import Fixture, Tool
from core.values.traces import Trace as Trace

GROUND_M = 400.0  # how long and wide a floor is
GRAVITY: Vector = (0.0, 0.0, -9.81)
FIXTURE = "fixture"
"""The name of the body that a design adds to a scene (`core.design.Fixture`).

A scene whose goals name it has a mark of this name, whose place the design's fixture takes.
"""


@dataclass(frozen=True)
class Geom:
    """One shape of a body, its pose in the body's frame, and its colour (red, green, blue, opacity; 0..1)."""

    shape: Shape
    pose: Pose = field(default_factory=Pose)
    color: Color = (0.7, 0.7, 0.7, 1.0)

    def convex_parts(self) -> tuple[Geom, ...]:
        """Return the convex shapes that collide in its place."""
        if self.shape.is_convex:
            return (self,)

        return tuple(replace(self, shape=part) for part in self.shape.convex_parts())


@dataclass(frozen=True)
class Body:
    """A rigid body, free to move, or fixed if its mass is 0.

    ``visuals`` are drawn, ``collisions`` collide, as their convex parts. A collision `Mesh` means its convex hull, so
    hollow bodies are made of several convex parts; a body without collision parts is a mark that nothing touches. In
    every engine the friction coefficient of a contact is the geometric mean of the two bodies' ``friction``, and its
    restitution the product of theirs; the arm and its tools have none. ``rolling_friction`` is the torsional arm in
    metres.

    Raises:
        ValueError: a negative mass, a free body without collision parts, or a fixed one with a velocity.
    """

    name: str
    pose: Pose
    mass: float
    visuals: tuple[Geom, ...]
    collisions: tuple[Geom, ...]
    friction: float = 0.5
    rolling_friction: float = 0.0
    restitution: float = 0.0
    # Of its origin when the robot's motion begins, m/s and rad/s along the world's axes; until then it rests.
    velocity: Vector = (0.0, 0.0, 0.0)
    spin: Vector = (0.0, 0.0, 0.0)
    # Of a mark: the body that takes it along; what is seen of it is among the visuals of that body.
    carrier: str | None = None
    # The normal force of another thing, N, above which it breaks; 0: it never does.
    breaks_n: float = 0.0
    # What tools can hold it by, see `core.values.grips`.
    smooth: bool = False
    magnetic: bool = False
    loops: bool = False

    def __post_init__(self) -> None:
        parts = chain.from_iterable(part.convex_parts() for part in self.collisions)
        object.__setattr__(self, "collisions", tuple(parts))
        rigid = not isinstance(self, Soft)
        speeds = [*self.velocity, *self.spin]
        problems = {
            f"the mass must be 0 (fixed) or positive, got {self.mass}": not (
                np.isfinite(self.mass) and self.mass >= 0
            ),
            "a body that can move needs collision parts": (
                self.mass > 0 and rigid and not self.collisions
            ),
            "only a mark has a carrier": self.carrier is not None and self.mass > 0,
            f"breaks_n must be 0 (never) or positive, got {self.breaks_n}": (
                not 0 <= self.breaks_n < np.inf
            ),
            "what is soft or does not collide can't break": (
                self.breaks_n > 0 and not self.collisions
            ),
            "a velocity needs finite numbers, and a mass above 0": (
                not np.isfinite(speeds).all() or (self.fixed and self.launched)
            ),
        }
        refuse(f"body {self.name!r}: ", problems)

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
        """Make a body of one shape, visual and collision shape alike."""
        part = (Geom(shape, color=color),)
        pose = Pose.xyz_rpy(position, rpy)
        return cls(name, pose, mass, part, part, friction, rolling_friction)

    @classmethod
    def mark(cls, name: str, position: Vector, radius: float, color: Color) -> Body:
        """Make a flat round mark: visible, without collision shape."""
        disc = Geom(Cylinder(radius, 0.001), Pose(np.array([0.0, 0.0, 0.0005])), color)
        return cls(name, Pose(np.asarray(position, dtype=np.float64)), 0.0, (disc,), ())

    @property
    def fixed(self) -> bool:
        return self.mass == 0

    @property
    def surface(self) -> tuple[str, ...]:
        """What tools can hold it by, in words."""
        words = {"smooth": self.smooth, "magnetic": self.magnetic, "looped": self.loops}
        return tuple(word for word, holds in words.items() if holds)

    @property
    def collides(self) -> bool:
        """Whether anything touches it: it is no mark."""
        return bool(self.collisions)

    @property
    def touched(self) -> tuple[Geom, ...]:
        """What others touch of it, as shapes in its frame."""
        return self.collisions

    @property
    def spawn(self) -> Pose:
        """Its pose in the state at the start."""
        return self.pose

    def pose_in(self, state: State) -> Pose:
        """Return where it is in the state of one world."""
        return self.pose if self.fixed else state.pose(self.name)

    @property
    def launched(self) -> bool:
        """Whether it gets a velocity when the motion begins."""
        return any((*self.velocity, *self.spin))


@dataclass(frozen=True)
class Soft(Body):
    """A rope, a cloth or a soft solid, elastic; make one with `make`. Few engines can have one.

    It has no collision parts: its nodes and what is between them collide, but not with each other. As it is made,
    nothing in it is strained. Nodes that are ``pinned`` stay where they are. A contact's friction coefficient is the
    geometric mean of its own and the tool's, whatever it touches.

    Raises:
        ValueError: it is fixed or launched, has too many nodes, is too stiff, or has elements without a size.
    """

    _: KW_ONLY
    form: Form
    elastic: Elastic
    pinned: tuple[int, ...] = ()

    collides = True

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = self.form.kind
        most = self.form.most_young
        count = len(self.form.nodes)
        problems = {
            "it can't be fixed or have a velocity; pin nodes to hold it": (
                self.fixed or self.launched
            ),
            f"the Young's modulus of a {kind} can be {most:g} Pa at most": (
                self.elastic.young > most
            ),
            f"pinned nodes have numbers from 0 to {count - 1}, and not all": not (
                set(self.pinned) < set(range(count))
            ),
        }
        refuse(f"soft body {self.name!r}: ", problems)

    @classmethod
    def make(
        cls,
        name: str,
        form: Form,
        elastic: Elastic,
        pose: Pose,
        *,
        color: Color,
        pinned: Sequence[int] = (),
    ) -> Soft:
        """Make one that weighs what its material does."""
        drawn = (Geom(form.surface(form.nodes), color=color),)
        return cls(
            name,
            pose,
            elastic.density * form.volume,
            drawn,
            collisions=(),
            friction=elastic.friction,
            form=form,
            elastic=elastic,
            pinned=tuple(pinned),
        )

    @property
    def touched(self) -> tuple[Geom, ...]:
        """Its surface."""
        return self.visuals

    @property
    def spawn(self) -> Pose:
        return Pose(self.center)

    def pose_in(self, state: State) -> Pose:
        """Return its pose at spawn, moved as its middle is."""
        shift = state.position(self.name) - self.center
        return Pose(self.pose.position + shift, self.pose.quaternion)

    @property
    def placed(self) -> Array:
        """The nodes (N, 3) in the world at spawn."""
        return self.pose.apply(self.form.nodes)

    @property
    def center(self) -> Array:
        """The centre of mass (3,) in the world at spawn."""
        return self.form.weights @ self.placed


@dataclass(frozen=True)
class Scene:
    """All bodies in the world, without the robot, and the joints between them.

    A body hangs from at most one joint, and no joints form a circle. ``gravity`` is in m/s^2, along the world's axes.
    ``bonds`` hold bodies until a force breaks them. ``fixture`` is what a design adds, and among the bodies too; see
    `furnished`. ``hindered`` is that of `State`.

    Raises:
        ValueError: two bodies, joints or bonds have the same name; a joint or a bond can't be where it is; or too many
            soft nodes.
    """

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...] = ()
    gravity: Vector = GRAVITY
    bonds: tuple[Bond, ...] = ()
    fixture: Fixture | None = None
    hindered: Mapping[object, str] = field(default_factory=dict)

    def __hash__(self) -> int:  # much is kept by scene, and layouts differ in places
        return hash(tuple((body.name, body.pose) for body in self.bodies))

    def __post_init__(self) -> None:
        self._check_names("bodies", [body.name for body in self.bodies])
        self._check_names("joints", [joint.name for joint in self.joints])
        nodes = sum(len(soft.form.nodes) for soft in self.softs)
        if nodes > MAX_NODES:
            raise ValueError(
                f"the soft bodies of a scene can have {MAX_NODES} nodes in all, not {nodes}; take fewer"
            )
        self._check_joints()
        self._check_bonds()
        _ = self.ordered_joints  # raises an error where they form a circle

    def _check_names(self, what: str, names: list[str]) -> None:
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(
                f"two {what} in the scene have the same name: {', '.join(repeated)}"
            )

    def _check_joints(self) -> None:
        hanging = set[str]()
        for link in self.joints:
            where = f"joint {link.name!r}"
            ends = self._find_ends(link, where)
            body = ends[0]
            problems = {
                "a joint can't hold a soft body; pin nodes of it": any(
                    isinstance(end, Soft) for end in ends
                ),
                f"its body {body.name!r} is fixed; give it a mass": body.fixed,
                f"its body {body.name!r} can't start with a velocity; use a drive": (
                    body.launched
                ),
                f"its body {body.name!r} hangs from another joint already": (
                    body.name in hanging
                ),
            }
            refuse(f"{where}: ", problems, link)
            hanging.add(body.name)

    def _check_bonds(self) -> None:
        bodies = {body.name: body for body in self.bodies}
        names = [bond.name for bond in self.bonds]
        self._check_names("bonds and bodies", [*names, *bodies])

        for link in self.bonds:
            where = f"bond {link.name!r}"
            ends = self._find_ends(link, where)
            problems = {
                "a bond can't hold a soft body or a mark": any(
                    not end.collisions for end in ends
                ),
                f"its body {link.body!r} is fixed; give it a mass": ends[0].fixed,
            }
            refuse(f"{where}: ", problems, link)

    def _find_ends(self, link: Joint | Bond, where: str) -> list[Body]:
        """Find the body that a joint or bond is of, and what holds it, unless that is the world.

        Raises:
            WrongPart: one of them is not there; says ``where``.
        """
        bodies = {body.name: body for body in self.bodies}
        names = [name for name in (link.body, link.parent) if name is not None]
        for name in names:
            if name not in bodies:
                raise WrongPart(
                    f"{where}: there is no body {name!r}; there are: {', '.join(bodies)}",
                    link,
                )

        return [bodies[name] for name in names]

    def find_anchor(self, bond: Bond) -> Array:
        """Find the point of a bond in the frame of its parent, or in the world, (3,), m."""
        point = self[bond.body].pose.apply(bond.origin)
        if bond.parent is None:
            return point

        return self[bond.parent].pose.inverse().apply(point)

    def __getitem__(self, name: str) -> Body:
        for body in self.bodies:
            if body.name == name:
                return body
        known = [body.name for body in self.bodies]
        raise unknown("body", name, "in the scene", known)

    @property
    def free(self) -> tuple[Body, ...]:
        """The bodies that can move, in the order of `State.names`."""
        return tuple(body for body in self.bodies if not body.fixed)

    @property
    def softs(self) -> tuple[Soft, ...]:
        """The soft bodies, in order."""
        return tuple(body for body in self.bodies if isinstance(body, Soft))

    def state(self) -> State:
        """The state of the free bodies at their initial poses, at rest."""
        poses = [body.spawn for body in self.free]
        count = len(poses)
        state = State(
            tuple(body.name for body in self.free),
            np.array([pose.position for pose in poses]).reshape(count, 3),
            np.array([pose.quaternion for pose in poses]).reshape(count, 4),
            np.zeros((count, 3)),
            np.zeros((count, 3)),
            soft={body.name: body.placed for body in self.softs},
        )
        return self.complete(state)

    @cached_property
    def placed_joints(self) -> dict[str, PlacedJoint]:
        """The joints in this layout, by name."""
        poses = {None: Pose()} | {body.name: body.pose for body in self.bodies}
        return {
            joint.name: PlacedJoint.of(joint, poses[joint.body], poses[joint.parent])
            for joint in self.joints
        }

    @cached_property
    def ordered_joints(self) -> tuple[PlacedJoint, ...]:
        """The joints in an order in which a parent's own joint comes first.

        Raises:
            ValueError: they form a circle.
        """
        waiting = {joint.body: joint for joint in self.joints}
        ordered = list[PlacedJoint]()

        while waiting:
            ready = [j for j in waiting.values() if j.parent not in waiting]
            if not ready:
                names = ", ".join(sorted(waiting))
                raise ValueError(
                    f"among the joints of {names} is a circle; leave one of them out"
                )

            for joint in ready:
                ordered.append(self.placed_joints[joint.name])
                del waiting[joint.body]

        return tuple(ordered)

    @cached_property
    def joined(self) -> frozenset[frozenset[str]]:
        """The pairs of bodies that a joint connects, which never collide."""
        return frozenset(
            frozenset((joint.body, joint.parent))
            for joint in self.joints
            if joint.parent is not None
        )

    def find_hinge(self, name: str) -> str:
        """Find the joint by which a body, or what it hangs from, is joined to something fixed; empty: there is none."""
        joints = {joint.body: joint for joint in self.joints}
        while name in joints:
            joint = joints[name]
            if joint.parent is None or self[joint.parent].fixed:
                return joint.name
            name = joint.parent

        return ""

    @property
    def breakable(self) -> dict[str, float]:
        """The force above which each thing breaks that can, N, by name."""
        things: list[Bond | Body] = [*self.bonds, *self.bodies]
        return {thing.name: thing.breaks_n for thing in things if thing.breaks_n > 0}

    @property
    def places(self) -> dict[str, Pose]:
        """The poses of fixed bodies, and of marks that stay, by name."""
        return {
            body.name: body.pose
            for body in self.bodies
            if body.fixed and body.carrier is None
        }

    @property
    def carried(self) -> dict[str, tuple[str, Pose]]:
        """The body that takes each other mark along, and the mark's pose in its frame, by the mark's name."""
        found = {}
        for mark in self.bodies:
            if mark.carrier is not None:
                frame = self[mark.carrier].pose.inverse()
                found[mark.name] = (mark.carrier, frame @ mark.pose)

        return found

    def furnished(self, tool: Tool | None) -> Scene:
        """Return the scene with the fixture of a tool's design; the same where there is none."""
        if tool is None or tool.fixture is None:
            return self
        return _furnish(self, tool)

    def with_starts(self, starts: Mapping[str, float]) -> Scene:
        """Return the scene whose joints, by name, start elsewhere; bodies that hang from them go along.

        Raises:
            ValueError: a joint can't start there.
        """
        poses = {None: Pose()} | {body.name: body.pose for body in self.bodies}

        for placed in self.ordered_joints:
            joint = placed.joint
            value: Array = np.array(starts.get(joint.name, joint.start))
            speed: Array = np.zeros(())
            if joint.kind == "ball":
                value = np.array([1.0, 0.0, 0.0, 0.0])
                speed = np.zeros(3)

            parent = Placement.at_rest(poses[joint.parent])
            moved = placed.carry(value, speed, parent)
            poses[joint.body] = Pose(moved.position, moved.quaternion)

        for mark, (carrier, offset) in self.carried.items():
            poses[mark] = poses[carrier] @ offset

        bodies = [replace(body, pose=poses[body.name]) for body in self.bodies]
        joints = [
            replace(joint, start=starts.get(joint.name, joint.start))
            for joint in self.joints
        ]
        return replace(self, bodies=tuple(bodies), joints=tuple(joints))

    def complete(self, state: State) -> State:
        """Add the places of fixed bodies and marks, and the joints, to a state of free bodies, as rewards get it."""
        return replace(
            state,
            places=self.places,
            joints=self.placed_joints,
            carried=self.carried,
            bonds={bond.name: bond for bond in self.bonds},
            pinned=tuple(soft.name for soft in self.softs if soft.pinned),
            fixture=self.fixture,
            hindered=self.hindered,
        )


@lru_cache(maxsize=64)  # engines prepare a scene once, while it is the same object
def _furnish(scene: Scene, tool: Tool) -> Scene:
    fixture = tool.fixture
    assert fixture is not None
    parts = fixture.parts
    drawn = []
    for component in parts.components:
        _, pose = parts.placed()[component.name]
        drawn.append(Geom(component.shape, pose, component.color))

    solid = tuple(Geom(part.shape, part.pose) for part in parts.parts)
    body = Body(FIXTURE, fixture.pose, 0.0, tuple(drawn), solid, parts.friction)
    others = [other for other in scene.bodies if other.name != FIXTURE]
    return replace(scene, bodies=(*others, body), fixture=fixture)


@dataclass(frozen=True)
class Region:
    """A box along the world's axes, from its lowest corner to its highest, metres."""

    low: Vector
    high: Vector

    def holds(self, middle: Array, half: Array) -> bool:
        """Check if a box along the axes is in it, with its middle (3,) and half lengths (3,)."""
        low = middle - half - self.low
        high = self.high - middle - half
        return bool(np.min([low, high]) > -1e-6)


@dataclass(frozen=True)
class Camera:
    """A camera at ``position``, looking at ``target``, world z up, or y where it looks straight down.

    ``fov_deg`` is the vertical field of view. With ``height_m`` the projection is parallel instead, and a picture shows
    so many metres from its bottom to its top.
    """

    position: Vector = (1.55, -1.15, 1.15)
    target: Vector = (0.55, 0.0, 0.15)
    fov_deg: float = 60.0
    height_m: float | None = None

    @property
    def axes(self) -> Array:
        """The directions to the right, up and forward in the picture, as rows (3, 3)."""
        forward = np.subtract(self.target, self.position)
        forward = forward / np.linalg.norm(forward)
        upright = [0.0, 0.0, 1.0]
        if np.hypot(forward[0], forward[1]) <= 1e-6:
            upright = [0.0, 1.0, 0.0]
        right = np.cross(forward, upright)
        right = right / np.linalg.norm(right)
        return np.stack([right, np.cross(right, forward), forward])


class View(TypedDict, total=False):
    """What a picture shows; what is left out or None is as at the start.

    Attributes:
        seed: of the layout; 0 if left out.
        tool: None: the bare arm.
        arm: (J,) radians; None: the task's home.
        fingers: (F,) metres, or with the tool's joints (F + K,); None: open.
        state: of the free bodies; None: as the scene has them.
        camera: None: the task's.
        width: pixels; 640 if left out.
        height: pixels; 480 if left out.
    """

    seed: int
    tool: Tool | None
    arm: Array | None
    fingers: Array | None
    state: State | None
    camera: Camera | None
    width: int
    height: int


def table() -> Body:
    """Make the table of most tasks: top face at z = 0, x from -0.15 to 1.35, y from -0.5 to 0.5, on four legs."""
    wood: Color = (0.76, 0.60, 0.42, 1.0)
    leg: Color = (0.35, 0.28, 0.22, 1.0)
    top = Geom(Box((1.5, 1.0, 0.04)), Pose(np.array([0.6, 0.0, -0.02])), wood)
    legs = tuple(
        Geom(Box((0.05, 0.05, 0.585)), Pose(np.array([x, y, -0.3325])), leg)
        for x in (-0.1, 1.3)
        for y in (-0.45, 0.45)
    )
    return Body("table", Pose(), 0.0, (top, *legs), (top, *legs))


def floor(height: float = -0.625, friction: float = 0.5) -> Body:
    """Make a floor with its upper face at z = ``height``. It goes on where it is no longer drawn."""
    slab = Geom(
        Box((6.0, 6.0, 0.1)),
        Pose(np.array([0.0, 0.0, height - 0.05])),
        (0.86, 0.87, 0.88, 1.0),
    )
    ground = replace(slab, shape=Box((GROUND_M, GROUND_M, 0.1)))
    return Body("floor", Pose(), 0.0, (slab,), (ground,), friction)
