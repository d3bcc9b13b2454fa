"""Check impacts and contacts: bodies leave, and press, as formulas say.

In an impact the surface stops a body's approach, and returns the restitution's share of it. Friction's impulse is at
most its coefficient times the surface's, and at most what stops the slip: all of the slip's momentum where a body can't
turn, 2/7 of it for a solid ball, a third for a cylinder. See D. Stewart, "Rigid-Body Dynamics with Friction and
Impact", SIAM Review 42 (2000).
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np

from core.design import RIGID_MOUNT, TOOL_FRICTION, Component, Tool
from core.geometry import Array, Box, Cylinder, Pose, Shape, Sphere
from core.interfaces import JointTrajectory, Recording, Rollout, Simulator
from core.scene import Body, Trace, table
from core.solids.contacts import find_contacts, make_trace
from plugins.conformance.checking import expect
from plugins.conformance.worlds import (
    BARE,
    FAR,
    GRAVITY,
    GREY,
    Bodies,
    arm,
    cube,
    end,
    film,
    motion,
    opened,
    run,
    slope,
    stick,
    still,
    wait,
)

# MuJoCo's convex contacts push a sliding body off a surface: a box by 0.18 of its speed at a friction of 0.5 and an
# angle of 75 degrees. PyBullet stays within 0.02, and SAPIEN, whose cylinders are prisms, within 0.08.
_OFF = 0.2
# Of a blow: contacts that are springs return up to a tenth of the speed, so MuJoCo's bodies leave 10 to 17 % too fast.
_FASTER = 0.2
_ASIDE = math.radians(7)  # MuJoCo has up to 5 degrees, the others 2
_LIGHTER = 0.1  # of the speed after a blow: all engines are within 5 %. Without the motor's inertia it is half

_TORQUE = 12.0  # Nm, the last joint's limit
_LINK = 0.01  # kg m^2 of the last link about the last joint, with a bar of 5 g


def _braked(shape: Shape, friction: float, angle: float, impulse: float = 1.0) -> float:
    """Compute what friction takes of the speed of an impact at an angle to the surface's normal.

    ``impulse`` is that of the surface, over what stops the approach.
    """
    stops_slip = {Sphere: 2 / 7, Cylinder: 1 / 3}.get(type(shape), 1.0)
    return min(friction * impulse * math.cos(angle), stops_slip * math.sin(angle))


def check_oblique_impact_on_a_slope(simulator: Simulator) -> None:
    """Bodies dropped from 0.5 m on slopes slide on, slowed by friction, or leave them with their restitution."""
    ball, can, tile = Sphere(0.05), Cylinder(0.05, 0.2), Box((0.2, 0.2, 0.04))
    cases: list[tuple[Shape, float, float]] = [(ball, 0.05, 0.0), (can, 0.05, 0.0), (tile, 0.02, 0.0)]
    cases += [(ball, 0.05, 0.6), (can, 0.05, 0.6)]
    fall, after = math.sqrt(2 * 0.5 / GRAVITY), 0.03
    speed = GRAVITY * fall
    for (shape, height, restitution), friction, degrees in product(cases, (0.1, 0.3, 0.5), (15, 30, 45, 60, 75)):
        tilt = math.radians(degrees)
        hill = replace(slope(tilt, friction), restitution=restitution)
        rpy = (math.pi / 2, 0.0, 0.0) if shape is can else (0.0, tilt, 0.0)
        at = np.add(hill.pose.apply([0, 0, 0.05 + height]), [0, 0, 0.5])
        body = Body.of("body", shape, at, mass=1.0, color=GREY, rpy=rpy, friction=friction)
        body = replace(body, restitution=float(restitution > 0))
        found = end(wait(simulator, hill, body, seconds=fall + after)).linear_velocity("body")
        gained = GRAVITY * after / speed  # by the fall after the impact; on the slope the same law holds for it
        braked = _braked(shape, friction, tilt, 1 + restitution)
        along = math.sin(tilt) * (1 + gained) - braked * (1 if restitution else 1 + gained)
        up = (restitution - gained) * math.cos(tilt) if restitution else 0.0
        due = speed * (
            along * np.array([math.cos(tilt), 0.0, -math.sin(tilt)])
            + up * np.array([math.sin(tilt), 0.0, math.cos(tilt)])
        )
        off = float(np.linalg.norm(found - due)) / speed
        what = f"{shape} fell with {speed:.2f} m/s on a slope of {degrees} degrees, friction {friction}, restitution "
        expect(off < _OFF, f"{what}{restitution}: it has {_pair(found)} m/s along x and z instead of {_pair(due)}")


def _pair(velocity: Array) -> str:
    return f"({velocity[0]:.2f}, {velocity[2]:.2f})"


def _ice() -> Body:
    return Body.of("ice", Box((4.0, 4.0, 0.1)), (1.0, 0.0, -0.05), mass=0.0, color=GREY, friction=0.0)


@lru_cache(maxsize=1)
def _sweep(speed: float) -> JointTrajectory:
    """Move the end-effector along y at a constant speed, from -0.1 to 0.02 m."""
    way = np.linspace(-0.1, 0.02, 25)
    joints = [arm().home_for(Pose(np.array([0.55, way[0], 0.29])))]
    for y in way[1:]:
        joints.append(arm().inverse(Pose(np.array([0.55, y, 0.29])), joints[-1]).joints)
    return JointTrajectory((way - way[0]) / speed, np.array(joints), opened(len(way)))


def check_oblique_blow_of_a_blade(simulator: Simulator) -> None:
    """A body on ice leaves a blade that moves at 0.6 m/s, turned against its motion, at a known speed and angle."""
    speed, ball, can, block = 0.6, Sphere(0.03), Cylinder(0.04, 0.04), Box((0.1, 0.1, 0.06))
    cases: list[tuple[Shape, float, int]] = [(block, 0.0, 0), (ball, 0.0, 0), (can, 0.0, 0)]
    cases += product((ball, can), (0.1, 0.3, 0.5, 0.8), (20, 40, 60))
    for shape, friction, degrees in cases:
        turn, (width, _, high) = math.radians(degrees), shape.bounds[1]
        away, along = np.array([[-math.sin(turn), math.cos(turn)], [math.cos(turn), math.sin(turn)]])
        x, y = [0.55, 0.0] + away * (0.01 + width / 2)
        of_tool = TOOL_FRICTION if shape is can else 0.3
        own = friction**2 / of_tool  # so that the contact has ``friction``
        puck = Body.of("puck", shape, (x, y, high / 2), mass=0.2, color=GREY, friction=own)
        pose = Pose.xyz_rpy((0.0, 0.0, -0.24), (0.0, 0.0, turn))
        blade = Component("blade", RIGID_MOUNT, pose, Box((0.3, 0.02, 0.08)))
        job = Rollout(Tool((*stick(0.2).components, blade), friction=of_tool), _sweep(speed), 0, 0.1, 0.0)
        left = end(run(simulator, (_ice(), puck), job)).linear_velocity("puck")[:2] / speed
        due = math.cos(turn) * away + _braked(shape, friction, turn) * along
        faster = float(np.linalg.norm(left) / np.linalg.norm(due))
        aside = math.atan2(left[1], left[0]) - math.atan2(due[1], due[0])
        what = f"{shape}, struck by a blade turned by {degrees} degrees, friction {friction}, left "
        expect(abs(faster - 1) < _FASTER, f"{what}{faster:.2f} times as fast as it should")
        expect(abs(aside) < _ASIDE, f"{what}{math.degrees(aside):.1f} degrees aside")


def check_blow_of_the_wrist_has_its_motor_behind_it(simulator: Simulator) -> None:
    """A puck struck by a light bar of 0.9 m on the turning wrist gets the speed that the motor's inertia gives it.

    Without restitution both keep the angular momentum that the wrist had, and the motor adds its largest torque.
    """
    rate, reach, radius = 2.0, 0.8, 0.03
    post = Component("post", RIGID_MOUNT, Pose(np.array([0.0, 0.0, -0.14])), Box((0.02, 0.02, 0.28)), 0.005)
    bar = Component("bar", RIGID_MOUNT, Pose(np.array([0.45, 0.0, -0.27])), Box((0.9, 0.01, 0.02)), 0.005)
    struck = 0.35  # s: 0.1 rad to get to speed in 0.1 s, and 0.5 rad
    times = np.linspace(0.0, struck + 0.02, 38)
    turned = np.where(times < 0.1, rate * times**2 / 0.2, rate * (times - 0.05)) - rate * (struck - 0.05)
    joints = np.repeat(arm().home_for(Pose(np.array([0.5, 0.0, 0.3])))[None], len(times), axis=0)
    joints[:, 6] -= turned  # the flange looks down: about z this is to the left
    inertia = arm().robot.motor_inertia[-1] + _LINK
    for mass in (0.5, 1.0):
        at = (0.5 + reach, 0.005 + radius, 0.03)
        puck = Body.of("puck", Cylinder(radius, 0.06), at, mass=mass, color=GREY, friction=0.0)
        trajectory = JointTrajectory(times, joints, opened(len(times)))
        job = Rollout(Tool((post, bar)), trajectory, 0, 0.1, 0.0, record_hz=200)
        recording = film(run(simulator, (_ice(), puck), job))
        since = float(recording.times[-1]) - struck
        together = inertia + mass * reach**2
        due = reach * (inertia * rate + _TORQUE * since) / together
        speed = float(np.linalg.norm(recording.states.linear_velocity("puck")[-1, :2]))
        what = f"{1000 * since:.0f} ms after a blow of the wrist at {rate * reach} m/s a puck of {mass} kg has "
        expect(abs(speed / due - 1) < _LIGHTER, f"{what}{speed:.2f} m/s instead of {due:.2f} m/s")


_FALL_M = 0.2
_LATE_S = 0.05  # of the first touch
_SHARE = 0.05  # of a weight that rests
_REACTION = 0.1  # of the force that presses


def _watch(
    simulator: Simulator, *bodies: Body, tool: Tool, trajectory: JointTrajectory, hold_s: float
) -> tuple[Trace, Recording]:
    """Simulate bodies; return the trace and the recording."""
    task = Bodies(*bodies)
    recording = film(run(simulator, bodies, Rollout(tool, trajectory, 0, 0.0, hold_s, 100.0, forces=True)))
    return make_trace(task.scene(0), [find_contacts(task.scene(0), task.robot, tool, recording)])[0], recording


def _steady(recording: Recording, one: str, other: str) -> float:
    """The mean force of two things in the last 0.4 s, N."""
    forces: Array = recording.forces.get((one, other), np.zeros(len(recording.times)))
    return float(forces[recording.times > recording.times[-1] - 0.4].mean())


def check_contact_begins_when_a_body_lands_and_bears_its_weight(simulator: Simulator) -> str | None:
    slab = Body.of("slab", Box((1.0, 1.0, 0.1)), FAR, mass=0.0, color=GREY)
    falls = cube("cube", (FAR[0], FAR[1], FAR[2] + 0.1 + _FALL_M), mass=2.0)
    trace, recording = _watch(simulator, slab, falls, tool=BARE, trajectory=still(), hold_s=2.0)
    lands, first = math.sqrt(2 * _FALL_M / GRAVITY), float(trace.first_s("cube", "slab"))
    what = f"a cube that falls {_FALL_M:g} m first touches the ground after {first:.3f} s"
    expect(abs(first - lands) < _LATE_S, f"{what}; it takes {lands:.3f} s")
    expect(bool(trace.touching_at_end("cube")), "a cube that lies on a slab does not touch it at the end")
    expect(not trace.touched("cube", "robot"), "a cube that lies far from the robot is touched by it")
    if not recording.forces:
        return "it measures no forces"
    weight, force = 2.0 * GRAVITY, _steady(recording, "slab", "cube")
    expect(abs(force / weight - 1) < _SHARE, f"a cube that weighs {weight:.2f} N lies on a slab with {force:.2f} N")
    return None


def check_body_passes_on_what_presses_it(simulator: Simulator) -> str | None:
    plan = [[0.5, 0, 0.45, 0, 0, 0], [0.5, 0, 0.395, 0, 0, 0]]  # 5 mm below the cube's upper side
    bodies = table(), cube(at=(0.5, 0, 0.05))
    trace, recording = _watch(simulator, *bodies, tool=stick(0.3), trajectory=motion(plan), hold_s=1.0)
    expect(bool(trace.touching_at_end("cube", "stick")), "a tool that presses a cube does not touch it at the end")
    expect(not trace.held("cube")[-1], "a cube that stands on the table counts as held by the tool that presses it")
    if not recording.forces:
        return "it measures no forces"
    above, below = _steady(recording, "tool", "cube"), _steady(recording, "table", "cube")
    expect(1 < above < 1000, f"a tool that is driven 5 mm into a cube presses it with {above:.1f} N")
    what = f"a cube that weighs {GRAVITY:.1f} N and is pressed with {above:.1f} N presses the table with {below:.1f} N"
    expect(abs(below - above - GRAVITY) < _REACTION * below, what)
    passed = float(trace.force_n("table", "robot"))
    expect(passed > 0.9 * above, f"of {above:.1f} N on a cube {passed:.1f} N count as what presses the table below it")
    if recording.pushes is None:
        return "it does not tell where forces act"
    late = recording.times[recording.pushes.samples] > recording.times[-1] - 0.4
    pushes, points = recording.pushes.forces[late], recording.pushes.points[late]
    count = np.count_nonzero(recording.times > recording.times[-1] - 0.4)
    up, where = float(pushes[:, 2].sum() / count), points.mean(axis=0)
    expect(
        abs(up - above) < _SHARE * above, f"a tool that presses down with {above:.1f} N is pushed up with {up:.1f} N"
    )
    here = f"a tool that presses the top of a cube at (0.5, 0, 0.1) is pushed at {np.round(where, 3).tolist()}"
    expect(bool(np.abs(where - (0.5, 0.0, 0.1)).max() < 0.02), here)
    return None
