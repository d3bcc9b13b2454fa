"""Every engine passes the checks of simulators."""

import subprocess
import sys
from pathlib import Path

import pytest

from core.interfaces import Ability
from core.plugins import installed
from plugins.conformance import bonds, free_bodies, playing, softs
from plugins.conformance.output import digest
from plugins.conformance.shared import LeftOut
from plugins.conformance.suites import SUITES
from tests.support.engines import every_simulator, mujoco_first, simulator

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
NEEDS = {
    softs.check_soft_rod_bends: Ability.SOFT_BODIES,
    bonds.check_bonds_bear_what_they_are_said_to: Ability.BONDS,
    bonds.check_bonds_hold_bodies_to_each_other: Ability.BONDS,
    free_bodies.check_light_bodies_slide_as_heavy_ones: Ability.LIGHT_BODIES,
    playing.check_going_on_is_playing_whole: Ability.FORKS,
}


@every_simulator
@pytest.mark.parametrize(
    "check", SUITES["sim"], ids=lambda check: check.__name__.removeprefix("check_")
)
def test_simulator(engine, check):
    made = simulator(engine)
    ability = NEEDS.get(check)
    if ability is not None and ability not in made.supports:
        with pytest.raises(
            LeftOut, match=f"(sim={engine}|it) does not support {ability}"
        ):
            check(made)
    else:
        check(made)


@mujoco_first
def test_same_bits_in_every_process_and_simulator(engine):
    first = digest(simulator(engine))
    assert digest(installed().create("sim", engine)) == first
    code = (
        "from plugins.conformance.output import digest; from core.plugins import installed;"
        f"print(digest(installed().create('sim', {engine!r})))"
    )
    again = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert again.stdout.strip() == first
