"""Engines that get impacts wrong fail the checks of them; that the built-in ones pass is tested with the engines."""

from dataclasses import replace

import pytest

from core.conformance import impacts
from core.conformance.worlds import Bodies
from core.interfaces import Simulator
from core.plugins import installed
from tests.engines import SIMULATORS, simulator


class Otherwise(Simulator):
    """Simulates another scene than the one it is given."""

    def __init__(self, engine, change):
        self.engine, self.change = simulator(engine), change

    def rollout(self, task, jobs):
        return self.engine.rollout(Bodies(*map(self.change, task.scene(0).bodies)), jobs)

    def render(self, task, views):
        raise NotImplementedError


def slippery(body):
    return replace(body, friction=body.friction / 9)


def rough(body):
    return replace(body, friction=4 * body.friction)


def dead(body):
    return replace(body, restitution=body.restitution / 2)


@pytest.mark.parametrize("engine", SIMULATORS)
@pytest.mark.parametrize(
    ("change", "check", "said"),
    [
        (slippery, impacts.check_oblique_impact_on_a_slope, "m/s along x and z instead of"),
        (dead, impacts.check_oblique_impact_on_a_slope, "m/s along x and z instead of"),
        (slippery, impacts.check_oblique_blow_of_a_blade, "degrees aside"),
        (rough, impacts.check_oblique_blow_of_a_blade, "degrees aside"),
    ],
)
def test_wrong_friction_or_restitution_is_found(engine, change, check, said):
    with pytest.raises(AssertionError, match=said):
        check(Otherwise(engine, change))


def test_friction_that_stops_slip_too_slowly_is_found():
    sluggish = installed().create("sim", "mujoco", slip_rate=20.0)
    for check in (impacts.check_oblique_impact_on_a_slope, impacts.check_oblique_blow_of_a_blade):
        with pytest.raises(AssertionError):
            check(sluggish)


@pytest.mark.parametrize(
    ("engine", "place"),
    [
        ("pybullet", "plugins.simulators.pybullet.world.MOTOR_INERTIA"),
        ("sapien", "plugins.simulators.sapien.robot.MOTOR_INERTIA"),
        ("mujoco", "plugins.simulators.mujoco.robot.MOTOR_INERTIA"),
    ],
)
def test_a_wrist_without_its_motors_inertia_is_found(engine, place, monkeypatch):
    """As it was in PyBullet and SAPIEN: a light stick's blow had hardly anything behind it but the motor's torque."""
    simulator(engine)
    monkeypatch.setattr(place, (1e-3,) * 7)
    if engine == "pybullet":
        from plugins.simulators.pybullet.world import driven_links

        monkeypatch.setattr("plugins.simulators.pybullet.world.driven_links", driven_links.__wrapped__)
    with pytest.raises(AssertionError, match=r"ms after a blow of the wrist at .* a puck of .* has"):
        impacts.check_blow_of_the_wrist_has_its_motor_behind_it(installed().create("sim", engine))
