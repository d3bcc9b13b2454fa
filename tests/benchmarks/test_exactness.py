import json

import numpy as np
import pytest

from core.config.compose import load, part
from core.errors import UserError
from core.interfaces import Outcome, Simulator
from plugins.conformance.worlds import GRAVITY
from tests.benchmarks.exactness import main, measure
from tests.support.panda import PANDA


@pytest.mark.thorough
@pytest.mark.parametrize("engine", ["mujoco", "sapien"])
def test_the_stored_figures_are_those_of_the_engine(engine):
    pytest.importorskip(engine)
    measured = measure(
        part("sim", load("evaluate", [f"sim={engine}"]).sim).create(), PANDA
    )
    stored = PANDA.measured[engine]
    assert measured.keys() == stored.keys()
    for name, figure in stored.items():
        least = 2e-4 if "rad" in name else 0.1  # radians; millimetres and newtons
        # None: too stiff to be seen.
        wanted = figure if figure is None else pytest.approx(figure, rel=0.1, abs=least)
        assert measured[name] == wanted, name


@pytest.mark.thorough
def test_a_slower_servo_is_less_exact_and_presses_less():
    lazy = measure(
        part(
            "sim", load("evaluate", ["sim=mujoco", "sim.tracking_rate=25"]).sim
        ).create(),
        PANDA,
    )
    usual = PANDA.measured["mujoco"]
    assert lazy["lag_mm"] > 1.5 * usual["lag_mm"]
    assert lazy["sag_mm_1kg"] > 2 * usual["sag_mm_1kg"]
    assert lazy["push_n_per_mm"] * lazy["sag_mm_1kg"] == pytest.approx(
        GRAVITY, rel=0.05
    )
    # Of the joints' torques.
    assert lazy["most_n"] == pytest.approx(usual["most_n"], rel=0.2)


class Broken(Simulator):
    def rollout(self, task, jobs):
        return [Outcome(None, None, error="the engine is out of order")]

    def render(self, task, **_):
        return np.zeros((1, 1, 3), np.uint8)


def test_an_engine_that_fails_is_named_as_the_cause():
    with pytest.raises(
        UserError, match=r"can't be measured: the engine is out of order"
    ):
        measure(Broken(), PANDA)


@pytest.mark.thorough
def test_the_command_writes_the_figures_of_the_engines_named(tmp_path, capsys):
    main(["sims=mujoco", f"output={tmp_path}/{{robot}}.json"])
    assert capsys.readouterr().out == f"{tmp_path}/panda.json\n"
    figures = json.loads((tmp_path / "panda.json").read_text())
    assert figures.keys() == {"mujoco"}
    assert figures["mujoco"].keys() == PANDA.measured["mujoco"].keys()
