"""Check what a tool's joints bear and that an arm can carry it, and estimate how far it bends, as beams.

The beams follow each other from the mount to a tip. A force F across a beam moves its tip by F times the integral of
r^2 / (E I), r being the distance from the tip (beam theory of Euler and Bernoulli), and stresses the outside of a
section of thickness t with F r t / 2 I. Torsion is left out, and so is that parallel chains of components bear a load
together. What is printed with walls and infill has the second moment of area I of its walls, and of its inside times
the infill.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from core.design import Bearer, DesignError, Tool, ToolJoint
from core.geometry import Array, Compound, Cylinder, Pose, Shape, mass_properties
from core.interfaces import Robot
from core.robot.kinematics import arm_of, open_mounts
from core.robot.solids import Solid, signed_distance, solid_geometry
from core.values.materials import Material

# Of joints. An engine's step is 2 to 5 ms: a spring or a damper that acts faster than that shakes or explodes in some.
# How strong springs may be follows from those that one can buy or print; docs/materials.md has the sources.
MAX_JOINTS = 8
MAX_TURN_RAD = 2 * math.pi
MAX_SLIDE_M = 0.5
MIN_RANGE = {
    "hinge": 0.01,
    "slider": 0.0005,
}  # radians, metres; an engine takes a range of next to nothing for none
MIN_MOVED_KG = 0.001
MAX_HZ = 20.0  # of what a spring moves, on its own
MAX_DECAY = 100.0  # 1/s, at which a damper stops what it moves
MAX_SPRING = {
    "hinge": 3.0,
    "slider": 50.0,
}  # N m and N, of a bought spring or brake of a hand tool's size
MAX_SPRINGS_J = 2.0  # of all bought springs of a tool
PRINTED_M3 = 20e-6  # of material, from which the springs of a tool are made
MAX_DAMPING = {
    "hinge": 0.2,
    "slider": 20.0,
}  # N m s/rad and N s/m, of a bought damper of that size
MAX_GAP_M = 0.001  # between a component and its parent
MAX_PIN_M = (
    0.01  # between a hinge's axis and each of its two sides: an eye around a pin
)
_UNITS = {"hinge": ("rad", "N m", "N m s/rad"), "slider": ("m", "N", "N s/m")}
_STEP_M, _FEWEST, _MOST = (
    0.005,
    9,
    201,
)  # between places in which the two sides of a joint must touch; their number

POINT_M = 1e-6  # what is shorter is no beam, and has no section
_CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8).T
Beam = tuple[
    Array, Array, float, float
]  # its ends, its length over E I, and half its thickness over I


def corners(shape: Shape | Compound, pose: Pose) -> Array:
    """Compute the corners (8, 3) of a shape's bounding box."""
    middle, size = shape.bounds
    return pose.apply(_CORNERS * size + middle)


class Beams:
    """The components of a tool of ``material`` as beams.

    ``joints`` holds for each component the point (3,) where it touches its parent, in its mount's frame.
    """

    def __init__(
        self, tool: Tool, joints: Mapping[str, Array], material: Material
    ) -> None:
        self.tool, self.joints, self.material = tool, joints, material
        self.placed = tool.placed()
        self._shapes = {
            component.name: component.shape for component in tool.components
        }
        # What carries each component, from the mount on: each carrier's name, and its beam up to the next joint.
        self.chains: dict[str, list[tuple[str, Beam]]] = {
            mount: [] for mount in tool.mounts
        }
        for component in tool.components:
            name, parent = component.name, component.parent
            own = (
                [(parent, self.beam(parent, joints[name]))]
                if parent in self._shapes
                else []
            )
            self.chains[name] = [*self.chains[parent], *own]

    def bending(self) -> dict[str, tuple[float, float]]:
        """Estimate for each component what a newton at its far end does: how far that moves, and the largest stress.

        The stress, in pascals, is that of the component or of what carries it.
        """
        bends = {}
        for component in self.tool.components:
            ends = corners(component.shape, self.placed[component.name][1])
            tip = ends[
                np.argmax(np.linalg.norm(ends - self.joints[component.name], axis=1))
            ]
            bends[component.name] = self.bend(component.name, tip)
        return bends

    def bend(self, name: str, point: Array) -> tuple[float, float]:
        """Estimate what a newton at a point (3,) of a component does, in the mount's frame: see `bending`."""
        beams = [*(beam for _, beam in self.chains[name]), self.beam(name, point)]
        starts, stops, soft, weak = map(np.array, zip(*beams, strict=True))
        a, b = starts - point, stops - point
        far = np.linalg.norm([a, b], axis=2).max(axis=0)
        return float(soft @ (a * a + a * b + b * b).sum(axis=1)) / 3, float(
            (weak * far).max()
        )

    def beam(self, name: str, stop: Array) -> Beam:
        """Return a component's part from where it is held to ``stop`` (3,).

        It bends about the weaker axis of the section across it, that of the bounding box. What fills a share s of its
        volume has s^2 of its stiffness, which is 5 % too much for a rod.
        """
        start, shape, material = self.joints[name], self._shapes[name], self.material
        along = int(
            np.argmax(
                np.abs((stop - start) @ self.placed[name][1].rotation.as_matrix())
            )
        )
        size = shape.bounds[1]
        thin, wide = sorted(np.delete(size, along))
        filled = shape.volume / float(np.prod(size))
        inner_thin, inner_wide = (
            max(0.0, side - material.wall_mm / 500) for side in (thin, wide)
        )
        share = filled**2 * (
            1 - (1 - material.infill) * inner_wide * inner_thin**3 / (wide * thin**3)
        )
        length = float(np.linalg.norm(stop - start))
        weak = 6 / (wide * thin**2 * share) if length > POINT_M else 0.0
        return (
            start,
            stop,
            length / (material.young_pa * wide * thin**3 / 12 * share),
            weak,
        )


GRAVITY = 9.81  # m/s^2


def moment_limit(robot: Robot) -> float:
    """Return the largest moment about the mount that the wrist bears in any posture, N m.

    It is the smallest effort limit of the last three joints, of which one is level in some posture.
    """
    return float(arm_of(robot).effort_limits[-3:].min())


def flange_moment(tool: Tool, robot: Robot) -> float:
    """Compute the largest moment of a tool's weight about the mount, N m: with its centre of mass level with it."""
    mounts, placed = open_mounts(robot, tool.gripper), tool.placed()
    weights = np.zeros(3)
    for c in tool.components:
        mount, pose = placed[c.name]
        weights += c.mass * (mounts[mount] @ pose).apply(
            mass_properties(c.shape, c.mass)[0]
        )
    return GRAVITY * float(np.linalg.norm(weights))


def mass_limit(robot: Robot, material: Material) -> tuple[float, str]:
    """Return how much a tool may weigh, kg, and the reason in words."""
    most_kg = math.inf if material.most_g is None else material.most_g / 1000
    if most_kg < robot.payload_kg:
        return most_kg, f"the budget of material is {most_kg:g} kg"
    return robot.payload_kg, f"the arm carries at most {robot.payload_kg:g} kg"


def check_weight(tool: Tool, robot: Robot, material: Material) -> None:
    """Refuse a tool that is too heavy for an arm or its material's budget, or of a real one too far out for its weight.

    Raises:
        DesignError: with the figures, and the component that weighs most.
    """
    heaviest = max(tool.components, key=lambda component: component.mass)
    mend = f"component {heaviest.name!r} weighs most, {heaviest.mass:.3g} kg: make parts thinner, shorter or fewer"
    most_kg, why = mass_limit(robot, material)
    if tool.mass > most_kg:
        raise DesignError(f"the tool weighs {tool.mass:.3g} kg; {why}; {mend}")
    moment, most = flange_moment(tool, robot), moment_limit(robot)
    if material.density_kg_m3 is not None and moment > most:
        raise DesignError(
            f"the tool, of {tool.mass:.3g} kg, turns the wrist with {moment:.3g} N m, its centre of mass being "
            f"{moment / GRAVITY / tool.mass:.3g} m from the mount; at most {most:g} N m are allowed; {mend}, or bring "
            "heavy parts closer to the mount"
        )


def spring_share(material: Material) -> float:
    """Compute which share of a bought spring's energy, torque and force springs of a material may have.

    A bent spring of rectangular section holds a ninth of what its volume would at its strength. Where the material has
    no strength, springs are bought.
    """
    if material.strength_pa is None:
        return 1.0
    return min(
        1.0,
        PRINTED_M3 * material.strength_pa**2 / (18 * material.young_pa) / MAX_SPRINGS_J,
    )


def check_joints(
    tool: Tool, material: Material, mounts: Mapping[str, Sequence[Solid]]
) -> None:
    """Check the joints of a tool; ``mounts`` are the solids of what it hangs from, each in its own frame.

    Raises:
        DesignError: the first rule that is broken.
    """
    if len(tool.bearers) > MAX_JOINTS:
        raise DesignError(
            f"the tool has {len(tool.bearers)} moving joints; at most {MAX_JOINTS} are allowed"
        )
    share, energies = spring_share(material), dict[str, float]()
    for bearer in tool.bearers:
        joint, where = bearer.joint, f"the joint of component {bearer.name!r}"
        _check_range(joint, where)
        _check_motion(tool, bearer, where)
        unit, pull, resists = _UNITS[joint.kind]
        strain = max(abs(joint.lower - joint.rest), abs(joint.upper - joint.rest))
        exerted, most = joint.stiffness * strain, share * MAX_SPRING[joint.kind]
        if exerted > most:
            raise DesignError(
                f"{where} has too strong a spring: it exerts {exerted:.3g} {pull} where it is {strain:.3g} {unit} from "
                f"its rest; at most {most:.2g} {pull} are allowed"
            )
        resisting = (
            ("damping", joint.damping, MAX_DAMPING, resists),
            ("dry friction", joint.friction, MAX_SPRING, pull),
        )
        for what, value, limits, shown in resisting:
            if value > (most := limits[joint.kind]):
                raise DesignError(
                    f"{where} has a {what} of {value:.3g} {shown}; at most {most:g} is allowed"
                )
        energies[bearer.name] = exerted * strain / 2
    if (energy := sum(energies.values())) > (most := share * MAX_SPRINGS_J):
        strongest = max(energies, key=lambda name: energies[name])
        raise DesignError(
            f"the tool's springs hold {energy:.3g} J at the ends of their ranges; at most {most:.2g} J are allowed: "
            f"give {strongest!r} a smaller range or a softer spring"
        )
    _check_touch(tool, mounts)


def _check_range(joint: ToolJoint, where: str) -> None:
    most, unit = (
        MAX_TURN_RAD if joint.kind == "hinge" else MAX_SLIDE_M,
        _UNITS[joint.kind][0],
    )
    if max(-joint.lower, joint.upper) > most:
        raise DesignError(
            f"{where} goes from {joint.lower:g} to {joint.upper:g} {unit}; at most {most:.3g} is allowed"
        )
    if joint.upper - joint.lower < (least := MIN_RANGE[joint.kind]):
        raise DesignError(
            f"{where} goes from {joint.lower:g} to {joint.upper:g} {unit}; give it a range of {least:g} or more, or no "
            "joint"
        )
    if not -most <= joint.rest <= most:
        raise DesignError(
            f"{where} has a spring that is relaxed at {joint.rest:g} {unit}; at most {most:.3g}"
        )


def _check_motion(tool: Tool, bearer: Bearer, where: str) -> None:
    """Refuse what moves too fast for an engine's steps."""
    joint, (mass, inertia) = bearer.joint, moved(tool, bearer)
    if mass < MIN_MOVED_KG:
        raise DesignError(
            f"{where} moves {mass:.2g} kg; at least {MIN_MOVED_KG:g} kg is needed"
        )
    hertz, decay = (
        math.sqrt(joint.stiffness / inertia) / (2 * math.pi),
        joint.damping / inertia,
    )
    if hertz > MAX_HZ:
        raise DesignError(
            f"{where} has too stiff a spring: what it moves would swing at {hertz:.0f} Hz, and at most {MAX_HZ:g} "
            f"can be simulated; a stiffness of {joint.stiffness * (MAX_HZ / hertz) ** 2:.2g} would do, or more mass"
        )
    if decay > MAX_DECAY:
        raise DesignError(
            f"{where} has too much damping: {joint.damping:g} for an inertia of {inertia:.2g}; at most "
            f"{MAX_DECAY * inertia:.2g} can be simulated; for more resistance give friction"
        )


def moved(tool: Tool, bearer: Bearer) -> tuple[float, float]:
    """Compute the mass (kg) of what moves on a joint as one, and its inertia about a hinge's axis (kg m^2); of a
    slider the mass again.

    What hangs on a further joint is left out: it need not follow.
    """
    joint, mass, inertia = bearer.joint, 0.0, 0.0
    axis: Array = np.array(joint.axis)
    for component in tool.components:
        own, pose = tool.borne[component.name]
        if own != bearer.name:
            continue
        center, tensor = mass_properties(component.shape, component.mass)
        turned = pose.rotation.inv().apply(axis)
        away: Array = np.cross(axis, pose.apply(center))
        mass += component.mass
        inertia += float(turned @ tensor @ turned + component.mass * (away @ away))
    return mass, inertia if joint.kind == "hinge" else mass


def _check_touch(tool: Tool, mounts: Mapping[str, Sequence[Solid]]) -> None:
    """Refuse a joint whose two sides come apart within its range: what joins them there must be a solid of one.

    The axis of a hinge must pass both at `MAX_PIN_M` or less, as a pin does.
    """
    sides = {name: list(mounts.get(name, ())) for name in tool.borne_on}
    for part in tool.parts:
        sides[part.bearer].append(
            Solid(part.component, solid_geometry(part.shape), part.pose)
        )
    for name, parent, frame, joint in tool.bearers:
        for side, pose in (
            ((name, Pose()), (parent, frame)) if joint.kind == "hinge" else ()
        ):
            away = min(
                signed_distance(solid, _pin(joint, sides[name], pose))
                for solid in sides[side]
            )
            if away > MAX_PIN_M:
                raise DesignError(
                    f"the hinge of {name!r} has an axis that passes {side!r} at {1000 * away:.0f} mm; at most "
                    f"{1000 * MAX_PIN_M:g} mm are allowed: put the axis where both are, or add an eye for its pin"
                )
        lever = (
            1.0
            if joint.kind == "slider"
            else max(_reach(solid) for solid in sides[name])
        )
        count = np.clip((joint.upper - joint.lower) * lever / _STEP_M, _FEWEST, _MOST)
        near: tuple[Solid, Solid] | None = None  # the two that touched last
        for value in np.linspace(joint.lower, joint.upper, int(count)).tolist():
            place = frame @ _moved_by(joint, value)
            if near is not None and _gap(*near, place) <= MAX_GAP_M:
                continue
            pairs = itertools.product(sides[parent], sides[name])
            near = next(
                (pair for pair in pairs if _gap(*pair, place) <= MAX_GAP_M), None
            )
            if near is None:
                raise DesignError(
                    f"component {name!r} leaves what bears it, {parent!r}, where its joint is at {value:.3g} "
                    f"{_UNITS[joint.kind][0]}: shorten the range, or add a rail that goes on touching"
                )


def _pin(joint: ToolJoint, beside: Sequence[Solid], pose: Pose) -> Solid:
    """Return a hinge's axis as a solid, as long as the solids ``beside`` it; ``pose`` is that of the joint's frame."""
    axis: Array = np.array(joint.axis)
    middles, halves = zip(*(solid.bounds() for solid in beside), strict=True)
    along, reach = np.array(middles) @ axis, np.array(halves) @ np.abs(axis)
    low, high = float((along - reach).min()), float((along + reach).max())
    turn, _ = Rotation.align_vectors([axis], [[0.0, 0.0, 1.0]])
    pin = Pose.from_rotation((low + high) / 2 * axis, turn)
    return Solid("pin", solid_geometry(Cylinder(1e-4, high - low)), pose @ pin)


def _moved_by(joint: ToolJoint, value: float) -> Pose:
    """The pose of a joint's link at a value, in its frame at 0."""
    way = value * np.array(joint.axis)
    return (
        Pose(way)
        if joint.kind == "slider"
        else Pose.from_rotation(np.zeros(3), Rotation.from_rotvec(way))
    )


def _gap(still: Solid, moving: Solid, place: Pose) -> float:
    return signed_distance(still, replace(moving, pose=place @ moving.pose))


def _reach(solid: Solid) -> float:
    """How far a solid extends from the origin of its frame, at most, metres."""
    center, half = solid.bounds()
    return float(np.linalg.norm(np.abs(center) + half))
