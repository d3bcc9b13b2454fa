"""Check latches, drives and launched bodies: they let go, move and fly as formulas say."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from core.geometry import Sphere
from core.interfaces import Simulator
from core.scene import Drive, Joint, Latch, Scene
from plugins.conformance.cases import Case, Measure, compare, play
from plugins.conformance.checking import near
from plugins.conformance.releases import BLOCK, BLOCK_KG
from plugins.conformance.scenery import FAR, cube, ground, make_body
from plugins.conformance.worlds import GRAVITY


def _value(joint: str) -> Measure:
    """A joint's value at the end, m or rad."""
    return lambda played: played.states.joint(joint).position[-1]


@compare
def check_latch_opens_at_its_force() -> Iterator[Case]:
    """A latch of 1.03 times a block's weight holds it, where its force is the weight; one of 0.97 lets it go."""
    width = 0.02
    hangs = -width / math.pi * math.asin(1 / 1.03)
    for share, due, within in ((1.03, hangs, 0.001), (0.97, -0.275, 0.225)):
        latch = Latch(0.0, share * BLOCK_KG * GRAVITY, width)
        free = Joint("s", "slider", "block", lower=-0.5, upper=0.5, damping=20.0)
        joint = replace(free, latches=(latch,))
        what = f"where a block hangs from a latch of {share} times its weight, m"
        yield Case(what, (BLOCK,), _value("s"), due, within, 3.0, (joint,))


def check_drive_keeps_its_schedule(simulator: Simulator) -> None:
    """A gate waits until the motion begins, follows its drive, and begins again."""
    drive = Drive((0.0, 0.5, 1.0), (0.1, 0.3, 0.1), 200.0, repeats=True)
    # m or rad: what the slowest servo that is allowed trails behind at its speed.
    lag = 0.4 / 50.0
    joint = Joint("gate", "slider", "block", start=0.1, drive=drive)
    played = play(simulator, Scene((BLOCK,), (joint,)), 2.0, settle_s=0.3)
    found = played.states.joint("gate").position
    near("where a driven slider is, m", found, drive.sample(played.times), lag + 0.004)


def check_launched_body_flies(simulator: Simulator) -> None:
    """A cube rests until the motion begins; then it flies along its parabola and spins as it was told."""
    velocity = np.array([1.0, 0.5, 3.0])
    spin = (0.0, 0.0, 4.0)
    resting = cube("cube", (FAR[0], FAR[1], 0.0501))
    thrown = replace(resting, velocity=tuple(velocity), spin=spin)
    played = play(simulator, Scene((ground(), thrown)), 0.5, settle_s=0.3)

    due = thrown.pose.position + velocity * 0.5 + [0, 0, -GRAVITY / 2 * 0.5**2]
    position = played.states.position("cube")[-1]
    near("where a cube is 0.5 s after its launch, m", position, due, 0.03)
    turning = played.states.angular_velocities[-1, 0]
    near("the spin of a launched cube, rad/s", turning, spin, 0.08)


def check_spinning_ball_is_braked(simulator: Simulator) -> None:
    """A ball that spins on the spot is braked by the torque of rolling friction: its arm times the weight."""
    radius = 0.05
    arm = 1e-4
    spin = 5.0
    lying = make_body("ball", Sphere(radius), (FAR[0], FAR[1], radius), mass=0.1)
    ball = replace(lying, rolling_friction=arm, spin=(0.0, 0.0, spin))
    played = play(simulator, Scene((ground(), ball)), 2.0, settle_s=0.3)

    due = spin - 2.0 * arm * GRAVITY / (0.4 * radius**2)
    turning = played.states.angular_velocities[-1, 0, 2]
    near("the spin of a ball after 2 s, rad/s", turning, due, 0.15)
