"""Hold bodies by bonds in PhysX: stiff springs to links that tell what they bear."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from core.errors import UsageError
from core.geometry import Array, Pose, Vector
from core.scene import Bond, Scene, State
from core.values.bearing import Flags
from core.values.joints import inverse, multiply
from plugins.simulators import bonds
from plugins.simulators.inertia import Inertia
from plugins.simulators.sapien.bodies import Weighed, weigh
from plugins.simulators.sapien.engine import physx
from plugins.simulators.sapien.shapes import Setup, to_sapien

# How far a bond gives way before it breaks, m. Points that are locked altogether strain each other: two bonds side by
# side then bear 14 % more than the weight, and with this spring 1 %.
_GIVES_WAY = 1e-4
# The damping of a bond, as a share of the critical one: of a sudden load it bears 0.4 % too much, with 1 10 %.
_DAMPING = 6.0
# So long no force is told, s: the springs take up their loads, and two bonds that hold a board by its end bear up to
# 12 % more meanwhile.
_LOADED_S = 0.05
# So many times the solver's iterations, as where there are joints.
_ITERATIONS = 4

# A free body that bears bonds gives so much of its mass to a link that is locked to it. With a hundredth, the lock
# gives way by 0.2 mm.
_CARRIED = 0.1
# A link that tells a force weighs so much of that body: what moves it is told, too.
_TELLS = 1e-4
# Where the link is locked to the body, in radii of inertia.
_LOCKS = ((1.0, 0.0, 0.0), (-0.5, 0.8, 0.0), (-0.5, -0.8, 0.0))
# Bonds of an articulation: it can have 64 links.
_MOST = 60
_UNMOVED = Inertia(1.0, Pose(), np.ones(3))


class Bonds(bonds.Bonds):
    """The bonds of a world whose bodies are at their initial poses.

    SAPIEN tells no force of a D6 joint, but it does of the links of an articulation. So a D6 joint holds the bond's
    point at a link of its own. That is fixed to the world, or to a link that is locked to the free body that bears it.

    Args:
        setup: of the world; the robot is in it.
        weighed: the scene.
        components: PhysX's of the free bodies, by name.
    """

    def __init__(
        self, setup: Setup, weighed: Weighed, components: Mapping[str, Any]
    ) -> None:
        scene = weighed.scene
        super().__init__(scene.bonds)
        self._time_step = setup.time_step
        self._articulations: list[Any] = []
        # Numbers of the bonds, as the articulations have them.
        self._order: list[int] = []
        # What each holds, and the D6 joint with the spring.
        self._held: dict[int, tuple[Any, Any]] = {}
        # Free bodies, and the articulations of the links that go with them.
        self._carried: list[tuple[Any, Any]] = []
        ends = dict.fromkeys(chain(*((b.body, b.parent) for b in scene.bonds)))
        names = [*components]
        self._bonded = [names.index(name) for name in ends if name and name in names]

        for bearer, numbers in _group(scene, components):
            borne = [scene.bonds[number] for number in numbers]
            points = [_find_point(scene, bond, bearer) for bond in borne]
            if bearer is None:
                root, *links = _fix_links(setup, points)
            else:
                body = components[bearer]
                root, *links = _carry_links(
                    setup, points, body, weighed.inertias[bearer]
                )
                self._carried.append((body, root.articulation))

            self._articulations.append(root.articulation)
            self._order += numbers
            for number, bond, link in zip(numbers, borne, links, strict=True):
                body = components[bond.body]
                _solve_like(body, root.articulation)
                self._held[number] = (body, _hold(bond, body, link))

    def launch(self) -> None:
        """Give the links that go with a body its velocity; call it when bodies are launched."""
        for body, articulation in self._carried:
            articulation.root_linear_velocity = body.linear_velocity
            articulation.root_angular_velocity = body.angular_velocity

    def correct_speeds(self, now: State, before: State, stepped: Flags) -> State:
        """Return states in which bodies with bonds are as fast as they moved in the last step.

        What springs and locks still want of them is in the speeds that PhysX tells, and comes to nothing: of a jar that
        hung still from its lid it told 22 mm/s.

        Args:
            now: the states (T,).
            before: those before the last step.
            stepped: where there was one (T,); else PhysX tells the speeds.
        """
        bodies = self._bonded
        moved = now.positions[:, bodies] - before.positions[:, bodies]
        back = inverse(before.quaternions[:, bodies])
        turned = multiply(now.quaternions[:, bodies], back)
        turned *= np.sign(turned[..., :1])  # the short way round

        linear = now.linear_velocities.copy()
        angular = now.angular_velocities.copy()
        for place, body in enumerate(bodies):
            linear[stepped, body] = moved[stepped, place] / self._time_step
            angular[stepped, body] = 2 * turned[stepped, place, 1:] / self._time_step

        return replace(now, linear_velocities=linear, angular_velocities=angular)

    def measure(self) -> Array:
        forces = np.zeros(len(self._order))
        if self.steps * self._time_step < _LOADED_S:
            return forces

        told = [
            articulation.link_incoming_joint_forces[1:, :3]
            for articulation in self._articulations
        ]
        forces[self._order] = np.linalg.norm(np.concatenate(told), axis=1)
        return forces

    def release(self, number: int) -> None:
        body, joint = self._held.pop(number)
        body.entity.remove_component(joint)
        body.wake_up()


def _group(
    scene: Scene, components: Mapping[str, Any]
) -> Iterator[tuple[str | None, list[int]]]:
    """Yield the numbers of bonds that an articulation can tell, and the free body that bears them; None: it is fixed.

    Raises:
        UsageError: a free body bears too many.
    """
    groups: dict[str | None, list[int]] = {}
    for number, bond in enumerate(scene.bonds):
        bearer = bond.parent if bond.parent in components else None
        groups.setdefault(bearer, []).append(number)

    for bearer, numbers in groups.items():
        if bearer is not None and len(numbers) > _MOST:
            raise UsageError(
                f"sim=sapien: {len(numbers)} bonds hold bodies to {bearer!r}, and it can handle {_MOST}; "
                "make fewer of them, each stronger, or take another engine"
            )

        for first in range(0, len(numbers), _MOST):
            yield bearer, numbers[first : first + _MOST]


def _find_point(scene: Scene, bond: Bond, bearer: str | None) -> Array:
    """Find a bond's point in the free body that bears it, or in the world (3,), m."""
    if bearer is not None:
        return scene.find_anchor(bond)
    return scene[bond.body].pose.apply(bond.origin)


def _fix_links(setup: Setup, points: Sequence[Array]) -> list[Any]:
    """Make a link that is fixed in the world, and one for each point of it (K, 3), m."""
    links = _make_links(setup, points, _UNMOVED, _UNMOVED)
    links[0].joint.type = "fixed"
    for link in links:
        link.disable_gravity = True

    return links


def _carry_links(
    setup: Setup, points: Sequence[Array], body: Any, inertia: Inertia
) -> list[Any]:
    """Make a link that is locked to a free body, and one for each point of it (K, 3), m.

    Together they weigh what the body did.
    """
    tells = _share(inertia, _TELLS)
    carried = _share(inertia, _CARRIED)
    left = 1.0 - _CARRIED - _TELLS * len(points)
    weigh(body, _share(inertia, left))

    links = _make_links(setup, points, carried, tells)
    articulation = links[0].articulation
    articulation.root_pose = body.entity_pose
    articulation.sleep_threshold = 0.0
    _solve_like(body, articulation)

    radius = math.sqrt(float(inertia.moments.max()) / inertia.mass)
    for lock in _LOCKS:
        point = inertia.frame.apply(radius * np.array(lock))
        joint = _join(body, point, links[0], point)
        joint.set_limit_x(0.0, 0.0)
        joint.set_limit_y(0.0, 0.0)
        joint.set_limit_z(0.0, 0.0)

    return links


def _make_links(
    setup: Setup, points: Sequence[Array], root: Inertia, other: Inertia
) -> list[Any]:
    """Make an articulation: a root, and a link for each point in its frame (K, 3), m, which is fixed to it.

    Args:
        setup: of the world.
        points: where the links are.
        root: its inertia.
        other: that of each other link, with its place in the root's frame.
    """
    first = physx.PhysxArticulationLinkComponent(None)
    weigh(first, root)
    links = [first]
    for point in points:
        link = physx.PhysxArticulationLinkComponent(first)
        link.joint.type = "fixed"
        link.joint.pose_in_parent = to_sapien(Pose(point))
        frame = Pose(-point) @ other.frame
        weigh(link, Inertia(other.mass, frame, other.moments))
        links.append(link)

    for number, link in enumerate(links):
        setup.add(f"bond_{number}", link)

    first.articulation.solver_position_iterations *= _ITERATIONS
    return links


def _share(inertia: Inertia, share: float) -> Inertia:
    """Return the inertia of a share of a body's mass."""
    mass = share * inertia.mass
    moments = share * inertia.moments
    return Inertia(mass, inertia.frame, moments)


def _solve_like(body: Any, articulation: Any) -> None:
    """Give a body an articulation's iterations, and never let it sleep: then no force would be told."""
    body.solver_position_iterations = articulation.solver_position_iterations
    body.sleep_threshold = 0.0


def _hold(bond: Bond, body: Any, link: Any) -> Any:
    """Hold a bond's point of a body at a link by springs, and return the D6 joint."""
    joint = _join(body, bond.origin, link, (0.0, 0.0, 0.0))
    stiffness = bond.breaks_n / _GIVES_WAY
    damping = 2 * _DAMPING * math.sqrt(stiffness * body.mass)
    joint.set_drive_property_x(stiffness, damping)
    joint.set_drive_property_y(stiffness, damping)
    joint.set_drive_property_z(stiffness, damping)
    return joint


def _join(body: Any, point: Vector, link: Any, place: Vector) -> Any:
    """Make a D6 joint from a point of a body to a place in a link, each (3,), m; all moves in it."""
    joint = physx.PhysxDriveComponent(body)
    joint.parent = link
    joint.pose_in_child = to_sapien(Pose(np.asarray(point)))
    joint.pose_in_parent = to_sapien(Pose(np.asarray(place)))
    body.entity.add_component(joint)
    return joint
