"""Check impacts and contacts: bodies leave, and press, as formulas say.

In an impact the surface stops a body's approach, and returns the restitution's share of it. Friction's impulse is at
most its coefficient times the surface's, and at most what stops the slip: all of the slip's momentum where a body can't
turn, 2/7 of it for a solid ball, a third for a cylinder. See D. Stewart, "Rigid-Body Dynamics with Friction and
Impact", SIAM Review 42 (2000).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import numpy.typing as npt

from core.design import Tool
from core.geometry import Array, Box, Cylinder, Pose, Shape, Sphere
from core.interfaces import JointTrajectory, Recording, Rollout, Simulator
from core.scene import Body, Scene, Trace, table
from core.solids.contacts import find_contacts, make_trace
from plugins.conformance.cases import Case, Film, compare
from plugins.conformance.checking import between, near
from plugins.conformance.worlds import (
    GRAVITY,
    arm,
    box,
    cube,
    film,
    make_body,
    motion,
    opened,
    run,
    slope,
    stick,
)

# MuJoCo's convex contacts push a sliding body off a surface: a box by 0.18 of its speed at a friction of 0.5 and an
# angle of 75 degrees. PyBullet stays within 0.02, and SAPIEN, whose cylinders are prisms, within 0.08.
_OFF = 0.2
_LIGHTER = 0.1  # of the speed after a blow: all engines are within 5 %. Without the motor's inertia it is half

_TORQUE = 12.0  # Nm, the last joint's limit
_LINK = 0.01  # kg m^2 of the last link about the last joint, with a bar of 5 g

_ICE = make_body("ice", Box((4.0, 4.0, 0.1)), (1.0, 0.0, -0.05), friction=0.0)


def _braked(shape: Shape, friction: float, angle: float, impulse: float = 1.0) -> float:
    """Compute what friction takes of the speed of an impact at an angle to the surface's normal.

    ``impulse`` is that of the surface, over what stops the approach.
    """
    stops_slip = {Sphere: 2 / 7, Cylinder: 1 / 3}.get(type(shape), 1.0)
    return min(friction * impulse * math.cos(angle), stops_slip * math.sin(angle))


def _velocity(played: Film) -> Array:
    """The velocity of ``body`` at the end, (3,) m/s."""
    velocity: Array = played.states.linear_velocity("body")[-1]
    return velocity


@compare
def check_oblique_impact_on_a_slope() -> Iterator[Case]:
    """Bodies dropped from 0.5 m on slopes slide on, slowed by friction, or leave them with their restitution."""
    ball, can, tile = Sphere(0.05), Cylinder(0.05, 0.2), Box((0.2, 0.2, 0.04))
    thrown: list[tuple[Shape, float, float]] = [  # shape, height of its middle over the surface, restitution
        (ball, 0.05, 0.0),
        (can, 0.05, 0.0),
        (tile, 0.02, 0.0),
        (ball, 0.05, 0.6),
        (can, 0.05, 0.6),
    ]
    fall, after = math.sqrt(2 * 0.5 / GRAVITY), 0.03
    speed = GRAVITY * fall
    gained = after / fall  # by the fall after the impact; on the slope the same law holds for it
    for (shape, high, restitution), friction, degrees in product(thrown, (0.1, 0.3, 0.5), (15, 30, 45, 60, 75)):
        tilt = math.radians(degrees)
        hill = replace(slope(tilt, friction), restitution=restitution)
        rpy = (math.pi / 2, 0.0, 0.0) if shape is can else (0.0, tilt, 0.0)
        at = np.add(hill.pose.apply([0, 0, 0.05 + high]), [0, 0, 0.5])
        body = make_body("body", shape, at, mass=1.0, rpy=rpy, friction=friction)
        body = replace(body, restitution=float(restitution > 0))

        braked = _braked(shape, friction, tilt, 1 + restitution)
        if restitution:
            along = math.sin(tilt) * (1 + gained) - braked
            up = (restitution - gained) * math.cos(tilt)
        else:
            along = (math.sin(tilt) - braked) * (1 + gained)
            up = 0.0
        due = speed * hill.pose.rotation.apply([along, 0.0, up])
        what = (
            f"the velocity of {shape} that fell with {speed:.2f} m/s on a slope of {degrees} degrees, "
            f"friction {friction}, restitution {restitution}, m/s"
        )
        yield Case(what, (hill, body), _velocity, due, _OFF * speed, fall + after)


def check_blow_of_the_wrist_has_its_motor_behind_it(simulator: Simulator) -> None:
    """A puck struck by a light bar of 0.9 m on the turning wrist gets the speed that the motor's inertia gives it.

    Without restitution both keep the angular momentum that the wrist had, and the motor adds its largest torque.
    """
    rate, reach, radius = 2.0, 0.8, 0.03
    post = box("post", (0.02, 0.02, 0.28), (0.0, 0.0, -0.14), mass=0.005)
    bar = box("bar", (0.9, 0.01, 0.02), (0.45, 0.0, -0.27), mass=0.005)
    struck = 0.35  # s: 0.1 rad to get to speed in 0.1 s, and 0.5 rad
    times = np.linspace(0.0, struck + 0.02, 38)
    turned = np.where(times < 0.1, rate * times**2 / 0.2, rate * (times - 0.05)) - rate * (struck - 0.05)
    joints = np.tile(arm().home_for(Pose(np.array([0.5, 0.0, 0.3]))), (len(times), 1))
    joints[:, 6] -= turned  # the flange looks down: about z this is to the left
    job = Rollout(Tool((post, bar)), JointTrajectory(times, joints, opened(len(times))), 0, 0.1, 0.0, record_hz=200)
    inertia = arm().robot.motor_inertia[-1] + _LINK
    for mass in (0.5, 1.0):
        at = (0.5 + reach, 0.005 + radius, 0.03)
        puck = make_body("puck", Cylinder(radius, 0.06), at, mass=mass, friction=0.0)
        recording = film(run(simulator, (_ICE, puck), job))
        since = float(recording.times[-1]) - struck
        due = reach * (inertia * rate + _TORQUE * since) / (inertia + mass * reach**2)
        speed = np.linalg.norm(recording.states.linear_velocity("puck")[-1])
        what = f"the speed of a puck of {mass} kg after a blow of the wrist at {rate * reach} m/s, m/s"
        near(what, speed, due, _LIGHTER * due)


_SHARE = 0.05  # of a weight that rests, or of a force


def _watch(
    simulator: Simulator, bodies: tuple[Body, ...], tool: Tool, trajectory: JointTrajectory, hold_s: float
) -> tuple[Trace, Recording]:
    """Simulate bodies; return the trace and the recording."""
    recording = film(run(simulator, bodies, Rollout(tool, trajectory, 0, 0.0, hold_s, 100.0, forces=True)))
    scene = Scene(bodies)
    return make_trace(scene, [find_contacts(scene, arm().robot, tool, recording)])[0], recording


def _late(recording: Recording) -> npt.NDArray[np.intp]:
    """The samples of the last 0.4 s."""
    return np.flatnonzero(recording.times > recording.times[-1] - 0.4)


def _steady(recording: Recording, one: str, other: str) -> float:
    """The mean force of two things in the last 0.4 s, N; 0 if they never touch."""
    forces = recording.forces.get((one, other), np.zeros(len(recording.times)))
    return float(forces[_late(recording)].mean())


def check_body_passes_on_what_presses_it(simulator: Simulator) -> str | None:
    """A stick is driven 5 mm into a cube of 1 kg that stands on the table."""
    trajectory = motion([[0.5, 0, 0.45, 0, 0, 0], [0.5, 0, 0.395, 0, 0, 0]])
    trace, recording = _watch(simulator, (table(), cube(at=(0.5, 0, 0.05))), stick(0.3), trajectory, 1.0)
    if not recording.forces:
        return "it measures no forces"
    above = _steady(recording, "tool", "cube")
    below = _steady(recording, "table", "cube")
    between("the force of a tool that is driven 5 mm into a cube, N", above, 1, 1000)
    near("the force of a cube on the table that a tool presses, N", below, above + GRAVITY, 0.1 * below)
    passed = float(trace.force_n("table", "robot"))
    between("what counts as pressed by the robot on the table below a cube, N", passed, 0.9 * above)
    if recording.pushes is None:
        return "it does not tell where forces act"
    late = np.isin(recording.pushes.samples, _late(recording))
    up = recording.pushes.forces[late, 2].sum() / len(_late(recording))
    near("the force that pushes up a tool that presses a cube, N", up, above, _SHARE * above)
    where = recording.pushes.points[late].mean(axis=0)
    near("where a tool is pushed that presses the top of a cube, m", where, (0.5, 0.0, 0.1), 0.02)
    return None
