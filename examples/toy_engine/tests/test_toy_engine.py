"""The engine keeps the contract of `Simulator`. It fails the checks of physics, since it has none."""

from collections.abc import Callable

import pytest

from core.interfaces import Simulator
from core.plugins import PluginPart
from plugins.conformance.suites import SUITES, subject

CONTRACT = {
    "check_same_job_gives_same_bits",
    "check_batch_gives_what_each_job_alone_gives",
    "check_states_name_the_free_bodies_in_order",
    "check_recordings",
    "check_arm_follows_its_trajectory",
    "check_states_are_those_of_frames",
    "check_scene_of_the_job_is_played",
    "check_fast_ways_are_what_steps_give",
}
CHECKS = [check for check in SUITES["sim"] if check.__name__ in CONTRACT]


def test_the_checks_are_there() -> None:
    assert {check.__name__ for check in CHECKS} == CONTRACT


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_keeps_the_contract(check: Callable[[Simulator], object]) -> None:
    check(subject(PluginPart("sim", "toy")))
