"""What others damaged in a run's folder costs a command one line."""

import pytest

from tests.fuzz.folders import ready

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


def test_no_damage_to_a_run_ends_a_command_with_more_than_a_line():
    with ready() as cases:
        for seed in range(6):
            cases.try_one(seed)
    assert cases.findings == []
    assert cases.counts["errors of one line"] > 0
    assert cases.counts["commands"] == 18
