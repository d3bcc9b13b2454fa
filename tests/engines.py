"""The engines that tests are run in. Another one needs a line here, and nothing else anywhere."""

from functools import cache

import pytest

from core.interfaces import Simulator
from core.plugins import installed

# By name, and the module that it can't do without. MuJoCo Warp is slow without a graphics card, and has fewer tests, in
# tests/plugins/simulators/test_mujoco_warp.py.
SIMULATORS = {"pybullet": "pybullet", "sapien": "sapien", "mujoco": "mujoco"}

every_simulator = pytest.mark.parametrize("engine", SIMULATORS)


@cache
def simulator(engine: str) -> Simulator:
    """With its own defaults; made once per process. Where its module is missing, the test is skipped."""
    pytest.importorskip(SIMULATORS[engine], exc_type=ImportError)
    made: Simulator = installed().create("sim", engine)
    return made
