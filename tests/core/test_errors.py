import math

import pytest

from core.errors import (
    Fault,
    Problems,
    UsageError,
    UserError,
    check_positive,
    choices,
    fault,
)
from core.plugins.blame import PluginError


@pytest.mark.parametrize(
    ("wrong", "where", "message"),
    [
        (
            "OneBok",
            "",
            "no task 'OneBok' (did you mean 'OneBook'?); possible: BringCube, OneBook",
        ),
        (
            "onebook",
            "",
            "no task 'onebook' (did you mean 'OneBook'?); possible: BringCube, OneBook",
        ),
        (
            "Juggle",
            "this folder",
            "no task 'Juggle' in this folder; possible: BringCube, OneBook",
        ),
    ],
)
def test_a_wrong_name_is_answered_with_the_possible_ones(wrong, where, message):
    assert str(choices("task", wrong, {"OneBook", "BringCube"}, where)) == message


def test_there_may_be_no_possible_name():
    assert str(choices("task", "OneBook", [])) == "no task 'OneBook'; possible: none"


@pytest.mark.parametrize("number", [0, -1.0, math.nan, math.inf])
def test_numbers_that_are_not_positive_are_refused(number):
    check_positive("rollout.", segment_s=1e-9)
    with pytest.raises(
        UsageError, match=f"rollout.hold_s must be greater than 0, got {number}"
    ):
        check_positive("rollout.", segment_s=1.0, hold_s=number)


def caused(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(24, "Too many open files"), "OSError: [Errno 24] Too many open files"),
        (MemoryError(), "MemoryError"),
        (
            ModuleNotFoundError("No module named 'x'"),
            "ModuleNotFoundError: No module named 'x'",
        ),
        (
            RuntimeError("can't start new thread"),
            "RuntimeError: can't start new thread",
        ),
        (Fault("the worker process died"), "the worker process died"),
        (
            caused(
                PluginError("sim 'x' raised it"),
                caused(ValueError(), OSError(28, "full")),
            ),
            "sim 'x' raised it",
        ),
        (caused(UserError("no room"), OSError(28, "full")), "no room"),
        (ValueError("a box of no size"), None),
        (PluginError("sim 'x' raised ValueError"), None),
        (UserError("no such engine"), None),
        (None, None),
    ],
)
def test_faults_of_the_machine_are_told_from_those_of_a_design(error, said):
    assert fault(error) == said


def test_each_of_several_problems_stays_one_of_its_own():
    inner = Problems([UserError("no file; and no folder"), UserError("no home")])
    wrong = Problems([UsageError("no flange")])
    wrong.attempt(inner.report)
    with pytest.raises(UsageError) as caught:
        wrong.report()
    assert str(caught.value) == "no flange; and no file; and no folder; and no home"
    said = [str(problem) for problem in caught.value.problems]
    assert said == ["no flange", "no file; and no folder", "no home"]
