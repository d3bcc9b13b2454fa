import numpy as np
import pytest

from core.config.compose import load, part
from core.conformance import exactness
from core.conformance.exactness import measure
from core.errors import UserError
from core.interfaces import Outcome, Simulator
from core.robot.description import measured_figures


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["mujoco", "sapien"])
def test_the_stored_figures_are_those_of_the_engine(engine):
    pytest.importorskip(engine)
    measured = measure(part("sim", load("evaluate", [f"sim={engine}"]).sim).create())
    stored = measured_figures()[engine]
    assert measured.keys() == stored.keys()
    for name, figure in stored.items():
        least = 2e-4 if "rad" in name else 0.1  # radians; millimetres and newtons
        assert measured[name] == pytest.approx(figure, rel=0.1, abs=least), name


@pytest.mark.slow
def test_a_slower_servo_is_less_exact_and_presses_less():
    lazy = measure(part("sim", load("evaluate", ["sim=mujoco", "sim.tracking_rate=25"]).sim).create())
    usual = measured_figures()["mujoco"]
    assert lazy["lag_mm"] > 1.5 * usual["lag_mm"]
    assert lazy["sag_mm_1kg"] > 2 * usual["sag_mm_1kg"]
    assert lazy["push_n_per_mm"] * lazy["sag_mm_1kg"] == pytest.approx(exactness.GRAVITY, rel=0.05)
    assert lazy["most_n"] == pytest.approx(usual["most_n"], rel=0.2)  # of the joints' torques


class Broken(Simulator):
    def rollout(self, task, jobs):
        return [Outcome(None, None, error="the engine is out of order")]

    def render(self, task, **_):
        return np.zeros((1, 1, 3), np.uint8)


def test_an_engine_that_fails_is_named_as_the_cause():
    with pytest.raises(UserError, match=r"can't be measured: the engine is out of order"):
        measure(Broken())
