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

from core.design import Tool
from core.geometry import Box, Cylinder, Pose, Sphere
from core.interfaces import JointTrajectory, Simulator
from core.scene import Body, Geom, Scene, table
from plugins.conformance.cases import Case, compare, velocity
from plugins.conformance.scenery import box, cube, make_body, slope, stick
from plugins.conformance.shared import between, expect, near
from plugins.conformance.worlds import GRAVITY, arm, motion, opened, watch

_OFF = 0.08  # of the speed of an impact
_LIGHTER = 0.1  # of the speed after a blow: all engines are within 5 %. Without the motor's inertia it is half

_TORQUE = 12.0  # Nm, the last joint's limit
_LINK = 0.01  # kg m^2 of the last link about the last joint, with a bar of 5 g

_BLOW_HZ = 400.0  # in every engine a step or two
_BLOW_S = 0.02  # no blow lasts as long
_IMPULSE = 0.01  # of the momentum that a blow gives

_BAR = 0.002  # m, of a net

_ICE = make_body("ice", Box((4.0, 4.0, 0.1)), (1.0, 0.0, -0.05), friction=0.0)


@compare
def check_oblique_impact_on_a_slope() -> Iterator[Case]:
    """A ball that falls 0.5 m on a slope leaves it with its restitution, and with what friction leaves of its slip."""
    radius = 0.05
    restitution = 0.6
    fall = math.sqrt(2 * 0.5 / GRAVITY)
    after = 0.03
    speed = GRAVITY * fall
    gained = after / fall  # by the fall after the impact

    for friction, degrees in product((0.1, 0.5), (30, 60)):
        tilt = math.radians(degrees)
        hill = replace(slope(tilt, friction), restitution=restitution)
        place = np.add(hill.pose.apply([0, 0, 0.05 + radius]), [0, 0, 0.5])
        ball = make_body("ball", Sphere(radius), place, mass=1.0, friction=friction)

        # Along the slope and away from it, of the speed of the impact.
        braked = min(
            friction * (1 + restitution) * math.cos(tilt), 2 / 7 * math.sin(tilt)
        )
        along = math.sin(tilt) * (1 + gained) - braked
        up = (restitution - gained) * math.cos(tilt)

        yield Case(
            f"the velocity of a ball after its fall on a slope of {degrees} degrees, friction {friction}, m/s",
            (hill, replace(ball, restitution=1.0)),
            velocity("ball"),
            due=speed * hill.pose.rotation.apply([along, 0.0, up]),
            within=_OFF * speed,
            seconds=fall + after,
        )


def check_blow_of_the_wrist_has_its_motor_behind_it(simulator: Simulator) -> None:
    """A puck struck by a light bar of 0.9 m on the turning wrist gets the speed that the motor's inertia gives it.

    Without restitution both keep the angular momentum that the wrist had, and the motor adds its largest torque.
    """
    rate = 2.0
    struck = 0.35  # s: 0.1 s to get to speed, and 0.25 s at it
    reach = 0.8
    radius = 0.03
    mass = 0.5
    puck = make_body(
        "puck",
        Cylinder(radius, 0.06),
        (0.5 + reach, 0.005 + radius, 0.03),
        mass=mass,
        friction=0.0,
    )
    swing = _swing_bar(rate, struck)
    scene = Scene((_ICE, puck))
    recording = watch(simulator, scene, 0.0, 0.1, 200.0, *swing).recording

    since = float(recording.times[-1]) - struck
    inertia = arm().robot.motor_inertia[-1] + _LINK
    due = reach * (inertia * rate + _TORQUE * since) / (inertia + mass * reach**2)
    speed = np.linalg.norm(recording.states.linear_velocity("puck")[-1])
    near(
        "the speed of a puck of 0.5 kg after a blow of the wrist at 1.6 m/s, m/s",
        speed,
        due,
        _LIGHTER * due,
    )


def _swing_bar(rate: float, struck: float) -> tuple[Tool, JointTrajectory]:
    """Make a light bar, and the motion in which the wrist swings it to the left.

    Args:
        rate: of the wrist, rad/s, which it has after 0.1 s.
        struck: when the bar points ahead, seconds; it goes on for 0.02 s.
    """
    post = box("post", (0.02, 0.02, 0.28), (0.0, 0.0, -0.14), mass=0.005)
    bar = box("bar", (0.9, 0.01, 0.02), (0.45, 0.0, -0.27), mass=0.005)

    times = np.array([0.0, 0.05, 0.1, struck + 0.02])
    turned = rate * np.array([0.0, 0.0125, 0.05, struck - 0.03])
    joints = np.tile(arm().home_for(Pose(np.array([0.5, 0.0, 0.3]))), (len(times), 1))
    # The flange looks down: about z this is to the left.
    joints[:, 6] += rate * (struck - 0.05) - turned

    trajectory = JointTrajectory(times, joints, opened(len(times)))
    return Tool((post, bar)), trajectory


def check_a_net_holds_what_does_not_fit_through(simulator: Simulator) -> None:
    """Balls that fall 0.55 m stay on a net of thin bars with smaller holes, and fall through one with larger holes."""
    for size, share in product((0.003, 0.006, 0.012), (0.8, 1.6)):
        net = _make_net(share * size)
        place = np.add(net.pose.position, [share * size / 2, share * size / 2, 0.55])
        ball = make_body("ball", Sphere(size / 2), place, mass=0.001)
        scene = Scene((table(), net, ball))
        heights = watch(simulator, scene, 0.6).states.position("ball")[:, 2]
        least = heights.min() - net.pose.position[2]
        what = f"where a ball of {1000 * size:g} mm gets to on holes {share} times as wide, m above the net"
        if share < 1:
            between(what, least, 0.0, 0.05)
        else:
            between(what, least, -1.0, -0.1)


def check_a_thin_wall_stops_what_is_thrown(simulator: Simulator) -> None:
    """Balls of 3 and 20 mm that are thrown at 5 m/s don't go through an upright sheet of 2 mm, and fly past its end."""
    wall = make_body("wall", Box((0.4, 0.002, 0.4)), (0.8, 0.3, 0.3), mass=0.0)
    for size, x in product((0.003, 0.02), (0.8, 1.1)):
        thrown = make_body("ball", Sphere(size / 2), (x, 0.1, 0.4), mass=0.001)
        ball = replace(thrown, velocity=(0.0, 5.0, 0.0))
        way = watch(simulator, Scene((wall, ball)), 0.08).states.position("ball")[:, 1]
        what = f"how far a ball of {1000 * size:g} mm gets that is thrown at a wall, m"
        if x < 1:
            between(what, way.max(), 0.25, 0.3)
        else:
            between(what, way.max(), 0.4)


def _make_net(hole: float) -> Body:
    """Make a fixed net of bars 2 mm thick, 0.2 m above the table, with square holes so wide; one is in the middle."""
    pitch = hole + _BAR
    reach = 6 * pitch
    bars = []
    for number in range(-6, 7):
        off = number * pitch - _BAR / 2
        along = Pose(np.array([off, 0.0, 0.0]))
        across = Pose(np.array([0.0, off, 0.0]))
        bars.append(Geom(Box((_BAR, 2 * reach, _BAR)), along))
        bars.append(Geom(Box((2 * reach, _BAR, _BAR)), across))

    place = Pose(np.array([0.75, 0.3, 0.2]))
    return Body("net", place, 0.0, tuple(bars), tuple(bars))


def check_forces_are_those_that_press(simulator: Simulator) -> None:
    """A stick is driven 5 mm into a cube of 1 kg that stands on the table; below it presses with its weight, too."""
    trajectory = motion([[0.5, 0, 0.45, 0, 0, 0], [0.5, 0, 0.395, 0, 0, 0]])
    scene = Scene((table(), cube(at=(0.5, 0, 0.05))))
    played = watch(
        simulator, scene, 1.0, tool=stick(0.3), trajectory=trajectory, forces=True
    )
    recording = played.recording
    expect(recording.forces, "it is said to measure forces of contacts, and gave none")
    late = np.flatnonzero(recording.times > recording.times[-1] - 0.4)
    above = recording.forces["tool", "cube"][late].mean()
    below = recording.forces["table", "cube"][late].mean()

    between("the force of a tool that is driven 5 mm into a cube, N", above, 1, 1000)
    near(
        "the force of a cube on the table that a tool presses, N",
        below,
        above + GRAVITY,
        0.1 * below,
    )


def check_a_blow_gives_its_impulse_and_its_peak(simulator: Simulator) -> None:
    """An egg on ice is struck at 1.6 m/s: forces over the blow add up to its momentum, and are not smeared.

    On the mean over the 40 ms of a trace the force would be 2 N.
    """
    mass = 0.05
    size = 0.04
    place = (0.5 + 0.8, 0.005 + size / 2, size / 2)
    egg = make_body("egg", Box((size, size, size)), place, mass=mass, friction=0.0)
    scene = Scene((_ICE, egg))
    swing = _swing_bar(2.0, 0.35)
    recording = watch(simulator, scene, 0.0, 0.1, _BLOW_HZ, *swing, True).recording

    expect(recording.forces, "it is said to measure forces of contacts, and gave none")
    force = recording.forces["tool", "egg"]
    impulse = float(force[1:] @ np.diff(recording.times))
    momentum = mass * float(np.linalg.norm(recording.states.linear_velocity("egg")[-1]))
    near(
        "the impulse of a blow on an egg of 50 g, N s",
        impulse,
        momentum,
        _IMPULSE * momentum,
    )

    least = momentum / _BLOW_S
    between("the peak of the force of this blow, N", float(force.max()), least, 1000)
