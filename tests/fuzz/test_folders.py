"""What others damaged in a run's folder costs a command one line."""

import pytest

from tests.fuzz.folders import ready
from tests.support.rare import rare

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


@pytest.mark.parametrize("count", rare([6, 60], 6, mark="weekly"))
def test_no_damage_to_a_run_ends_a_command_with_more_than_a_line(count):
    with ready() as cases:
        for seed in range(count):
            cases.try_one(seed)
    assert cases.findings == []
    assert cases.counts["errors of one line"] > 0
    assert cases.counts["commands"] == 3 * count
