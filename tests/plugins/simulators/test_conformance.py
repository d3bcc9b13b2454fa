"""Every engine does what every simulator must. Another engine needs a line in `SIMULATORS`, and nothing else here."""

import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from core.conformance.simulator import CHECKS, digest
from core.plugins import installed

ROOT = Path(__file__).parents[3]
SIMULATORS = {"pybullet": "pybullet", "sapien": "sapien"}  # by name, and the module that it can't do without

every_simulator = pytest.mark.parametrize("name", SIMULATORS)


@cache
def simulator(name):
    pytest.importorskip(SIMULATORS[name])
    return installed().create("sim", name)


@every_simulator
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__.removeprefix("check_"))
def test_simulator(name, check):
    check(simulator(name))


@every_simulator
def test_same_bits_in_every_process_and_simulator(name):
    first = digest(simulator(name))
    assert digest(installed().create("sim", name)) == first
    code = (
        "from core.conformance.simulator import digest; from core.plugins import installed;"
        f"print(digest(installed().create('sim', {name!r})))"
    )
    again = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert again.stdout.strip() == first
