"""The engines that tests are run in. A new one needs a line here and nothing else."""

from functools import cache

import pytest

from core.interfaces import Simulator
from core.plugins import installed

# The module that each engine needs. MuJoCo Warp is slow without a graphics card, and has fewer tests, in
# tests/plugins/simulators/test_mujoco_warp.py.
SIMULATORS = {"pybullet": "pybullet", "sapien": "sapien", "mujoco": "mujoco"}

every_simulator = pytest.mark.parametrize("engine", SIMULATORS)
mujoco_first = pytest.mark.parametrize(  # the others are thorough
    "engine",
    [
        engine
        if engine == "mujoco"
        else pytest.param(engine, marks=pytest.mark.thorough)
        for engine in SIMULATORS
    ],
)


@cache
def simulator(engine: str) -> Simulator:
    """Return the engine with its defaults, made once per process. Skip the test where its module is missing."""
    pytest.importorskip(SIMULATORS[engine], exc_type=ImportError)
    made: Simulator = installed().create("sim", engine)
    return made
