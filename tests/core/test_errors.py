import math

import pytest

from core.errors import UsageError, check_positive, choices


@pytest.mark.parametrize(
    ("wrong", "where", "message"),
    [
        ("OneBok", "", "no task 'OneBok' (did you mean 'OneBook'?); possible: BringCube, OneBook"),
        ("onebook", "", "no task 'onebook' (did you mean 'OneBook'?); possible: BringCube, OneBook"),
        ("Juggle", "this folder", "no task 'Juggle' in this folder; possible: BringCube, OneBook"),
    ],
)
def test_a_wrong_name_is_answered_with_the_possible_ones(wrong, where, message):
    assert str(choices("task", wrong, {"OneBook", "BringCube"}, where)) == message


def test_there_may_be_no_possible_name():
    assert str(choices("task", "OneBook", [])) == "no task 'OneBook'; possible: none"


@pytest.mark.parametrize("number", [0, -1.0, math.nan, math.inf])
def test_numbers_that_are_not_positive_are_refused(number):
    check_positive("rollout.", segment_s=1e-9)
    with pytest.raises(UsageError, match=f"rollout.hold_s must be greater than 0, got {number}"):
        check_positive("rollout.", segment_s=1.0, hold_s=number)
