"""Check impacts and contacts: bodies leave, and press, as formulas say.

In an impact the surface stops a body's approach, and returns the restitution's share of it. Friction's impulse is at
most its coefficient times the surface's, and at most what stops the slip: all of the slip's momentum where a body can't
turn, 2/7 of it for a solid ball, a third for a cylinder. See D. Stewart, "Rigid-Body Dynamics with Friction and
Impact", SIAM Review 42 (2000).
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from core.design import Tool
from core.geometry import Box, Cylinder, Pose, Sphere
from core.interfaces import JointTrajectory, Simulator
from core.scene import Body, table
from plugins.conformance.sample_tools import box, stick
from plugins.conformance.shared import between, near
from plugins.conformance.worlds import (
    GRAVITY,
    Film,
    arm,
    compound,
    cube,
    make_body,
    motion,
    opened,
    part,
    slope,
    watch,
)

_OFF = 0.08  # of the speed of an impact
_LIGHTER = 0.1  # of the speed after a blow: all engines are within 5 %. Without the motor's inertia it is half

_TORQUE = 12.0  # Nm, the last joint's limit
_LINK = 0.01  # kg m^2 of the last link about the last joint, with a bar of 5 g
_RATE = 2.0  # rad/s, of the wrist at the blow
_STRUCK_S = 0.35  # 0.1 s to get to speed, and 0.25 s at it
_REACH = 0.8  # m, from the wrist to what it strikes

_BLOW_S = 0.02  # no blow lasts as long
_IMPULSE = 0.01  # of the momentum that a blow gives

_BAR = 0.002  # m, of a net


def check_oblique_impact_on_a_slope(simulator: Simulator) -> None:
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
        ball = make_body("ball", Sphere(radius), place, 1.0, friction=friction)
        bouncy = replace(ball, restitution=1.0)

        # Along the slope and away from it, of the speed of the impact.
        stopped = friction * (1 + restitution) * math.cos(tilt)
        braked = min(stopped, 2 / 7 * math.sin(tilt))
        along = math.sin(tilt) * (1 + gained) - braked
        up = (restitution - gained) * math.cos(tilt)
        due = speed * hill.pose.rotation.apply([along, 0.0, up])

        played = watch(simulator, hill, bouncy, hold_s=fall + after)
        found = played.states.linear_velocity("ball")[-1]
        near(
            f"the velocity of a ball after its fall on a slope of {degrees} degrees, friction {friction}, m/s",
            found,
            due,
            _OFF * speed,
        )


def _strike(simulator: Simulator, body: Body, **job: Any) -> Film:
    """Let a light bar of 0.9 m on the turning wrist strike a body on ice, from the right at 1.6 m/s, and go on."""
    post = box("post", (0.02, 0.02, 0.28), (0.0, 0.0, -0.14), mass=0.005)
    bar = box("bar", (0.9, 0.01, 0.02), (0.45, 0.0, -0.27), mass=0.005)
    ice = make_body("ice", Box((4.0, 4.0, 0.1)), (1.0, 0.0, -0.05), friction=0.0)

    times = np.array([0.0, 0.05, 0.1, _STRUCK_S + 0.02])
    turned = _RATE * np.array([0.0, 0.0125, 0.05, _STRUCK_S - 0.03])
    joints = np.tile(arm().home_for(Pose(np.array([0.5, 0.0, 0.3]))), (len(times), 1))
    # The flange looks down: about z this is to the left.
    joints[:, 6] += _RATE * (_STRUCK_S - 0.05) - turned
    swing = JointTrajectory(times, joints, opened(len(times)))

    job = {"tool": Tool((post, bar)), "way": swing, **job}
    return watch(simulator, ice, body, settle_s=0.1, hold_s=0.0, **job)


def check_blow_of_the_wrist_has_its_motor_behind_it(simulator: Simulator) -> None:
    """A puck struck by a light bar on the turning wrist gets the speed that the motor's inertia gives it.

    Without restitution both keep the angular momentum that the wrist had, and the motor adds its largest torque.
    """
    radius = 0.03
    mass = 0.5
    place = (0.5 + _REACH, 0.005 + radius, 0.03)
    puck = make_body("puck", Cylinder(radius, 0.06), place, mass, friction=0.0)
    struck = _strike(simulator, puck, record_hz=200.0)

    since = float(struck.times[-1]) - _STRUCK_S
    inertia = arm().robot.motor_inertia[-1] + _LINK
    momentum = inertia * _RATE + _TORQUE * since
    due = _REACH * momentum / (inertia + mass * _REACH**2)
    speed = np.linalg.norm(struck.states.linear_velocity("puck")[-1])
    near(
        "the speed of a puck of 0.5 kg after a blow of the wrist at 1.6 m/s, m/s",
        speed,
        due,
        _LIGHTER * due,
    )


def check_a_blow_gives_its_impulse_and_its_peak(simulator: Simulator) -> None:
    """An egg on ice is struck at 1.6 m/s: forces over the blow add up to its momentum, and are not smeared.

    On the mean over the 40 ms of a trace the force would be 2 N.
    """
    mass = 0.05
    size = 0.04
    place = (0.5 + _REACH, 0.005 + size / 2, size / 2)
    egg = make_body("egg", Box((size, size, size)), place, mass, friction=0.0)
    # In every engine an instant is a step or two.
    struck = _strike(simulator, egg, record_hz=400.0, forces=True)

    forces = struck.recording.forces
    assert forces, "it is said to measure forces of contacts, and gave none"
    force = forces["tool", "egg"]
    impulse = float(force[1:] @ np.diff(struck.times))
    speed = np.linalg.norm(struck.states.linear_velocity("egg")[-1])
    momentum = mass * float(speed)
    near(
        "the impulse of a blow on an egg of 50 g, N s",
        impulse,
        momentum,
        _IMPULSE * momentum,
    )
    least = momentum / _BLOW_S
    between("the peak of the force of this blow, N", force.max(), least, 1000)


def check_a_net_holds_what_does_not_fit_through(simulator: Simulator) -> None:
    """Balls that fall 0.55 m stay on a net of thin bars with smaller holes, and fall through one with larger holes."""
    for size, share in product((0.003, 0.006, 0.012), (0.8, 1.6)):
        net = _make_net(share * size)
        place = net.pose.apply([share * size / 2, share * size / 2, 0.55])
        ball = make_body("ball", Sphere(size / 2), place, 0.001)
        heights = watch(simulator, table(), net, ball, hold_s=0.6).path("ball")[:, 2]
        low, high = (0.0, 0.05) if share < 1 else (-1.0, -0.1)
        between(
            f"where a ball of {1000 * size:g} mm gets to on holes {share} times as wide, m above the net",
            heights.min() - net.pose.position[2],
            low,
            high,
        )


def check_a_thin_wall_stops_what_is_thrown(simulator: Simulator) -> None:
    """Balls of 3 and 20 mm that are thrown at 5 m/s don't go through an upright sheet of 2 mm, and fly past its end."""
    wall = make_body("wall", Box((0.4, 0.002, 0.4)), (0.8, 0.3, 0.3))
    for size, x in product((0.003, 0.02), (0.8, 1.1)):
        still = make_body("ball", Sphere(size / 2), (x, 0.1, 0.4), 0.001)
        ball = replace(still, velocity=(0.0, 5.0, 0.0))
        way = watch(simulator, wall, ball, hold_s=0.08).path("ball")[:, 1]
        low, high = (0.25, 0.3) if x < 1 else (0.4, math.inf)
        between(
            f"how far a ball of {1000 * size:g} mm gets that is thrown at a wall, m",
            way.max(),
            low,
            high,
        )


def _make_net(hole: float) -> Body:
    """Make a fixed net of bars 2 mm thick, 0.2 m above the table, with square holes so wide; one is in the middle."""
    pitch = hole + _BAR
    reach = 6 * pitch
    bars = []
    for number in range(-6, 7):
        off = number * pitch - _BAR / 2
        bars.append(part(Box((_BAR, 2 * reach, _BAR)), off, 0.0, 0.0))
        bars.append(part(Box((2 * reach, _BAR, _BAR)), 0.0, off, 0.0))

    return compound("net", *bars, at=(0.75, 0.3, 0.2))


def check_forces_are_those_that_press(simulator: Simulator) -> None:
    """A stick is driven 5 mm into a cube of 1 kg that stands on the table; below it presses with its weight, too."""
    bodies = (table(), cube(at=(0.5, 0, 0.05)))
    way = motion([[0.5, 0, 0.45, 0, 0, 0], [0.5, 0, 0.395, 0, 0, 0]])
    played = watch(simulator, *bodies, tool=stick(0.3), way=way, forces=True)
    forces = played.recording.forces
    assert forces, "it is said to measure forces of contacts, and gave none"
    late = played.times > played.times[-1] - 0.4
    above = forces["tool", "cube"][late].mean()
    below = forces["table", "cube"][late].mean()

    between("the force of a tool that is driven 5 mm into a cube, N", above, 1, 1000)
    near(
        "the force of a cube on the table that a tool presses, N",
        below,
        above + GRAVITY,
        0.1 * below,
    )
