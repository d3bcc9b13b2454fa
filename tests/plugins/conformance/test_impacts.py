"""Engines that get impacts wrong fail the checks of them; that the built-in ones pass is tested with the engines."""

from dataclasses import replace

import numpy as np
import pytest

from core.interfaces import Simulator
from core.plugins import installed
from plugins.conformance import impacts
from plugins.conformance.worlds import Bodies
from tests.support.engines import SIMULATORS, simulator
from tests.support.panda import PANDA

pytestmark = pytest.mark.slow


class Otherwise(Simulator):
    """Simulates another scene or robot than the one it is given."""

    def __init__(self, engine, change=lambda body: body, robot=PANDA):
        self.engine, self.change, self.robot = simulator(engine), change, robot

    def rollout(self, task, jobs):
        return self.engine.rollout(
            Bodies(*map(self.change, task.scene(0).bodies), robot=self.robot), jobs
        )

    def render(self, task, views):
        raise NotImplementedError


def slippery(body):
    return replace(body, friction=body.friction / 9)


def rough(body):
    return replace(body, friction=4 * body.friction)


def dead(body):
    return replace(body, restitution=body.restitution / 2)


@pytest.mark.parametrize("engine", SIMULATORS)
@pytest.mark.parametrize("change", [slippery, rough, dead])
def test_wrong_friction_or_restitution_is_found(engine, change):
    with pytest.raises(AssertionError, match=r"the velocity of .* instead of"):
        impacts.check_oblique_impact_on_a_slope(Otherwise(engine, change))


def test_friction_that_stops_slip_too_slowly_is_found():
    with pytest.raises(AssertionError):
        impacts.check_oblique_impact_on_a_slope(
            installed().create("sim", "mujoco", slip_rate=20.0)
        )


@pytest.mark.parametrize("engine", SIMULATORS)
def test_a_wrist_without_its_motors_inertia_is_found(engine):
    """As it was in PyBullet and SAPIEN: a light stick's blow had hardly anything behind it but the motor's torque."""
    light = replace(PANDA, motor_inertia=(1e-3,) * 7)
    with pytest.raises(
        AssertionError, match=r"the speed of a puck of .* after a blow of the wrist"
    ):
        impacts.check_blow_of_the_wrist_has_its_motor_behind_it(
            Otherwise(engine, robot=light)
        )


class Measured(Simulator):
    """Changes the forces that an engine measured."""

    def __init__(self, engine, change):
        self.engine = simulator(engine)
        self.supports = self.engine.supports
        self.change = change

    def rollout(self, task, jobs):
        (outcome,) = self.engine.rollout(task, jobs)
        recording = outcome.recording
        forces = {pair: self.change(f) for pair, f in recording.forces.items()}
        return [replace(outcome, recording=replace(recording, forces=forces))]

    def render(self, task, views):
        raise NotImplementedError


def smear(force):
    """Return means over 40 ms, as a trace holds them, with the same sum."""
    return np.mean([np.roll(force, -number) for number in range(16)], axis=0)


@pytest.mark.parametrize("engine", SIMULATORS)
@pytest.mark.parametrize(
    ("change", "wrong"), [(smear, "the peak"), (lambda force: force / 2, "the impulse")]
)
def test_forces_of_a_blow_that_are_smeared_or_too_small_are_found(
    engine, change, wrong
):
    with pytest.raises(AssertionError, match=wrong):
        impacts.check_a_blow_gives_its_impulse_and_its_peak(Measured(engine, change))
