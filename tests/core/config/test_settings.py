import math

import pytest

from core.config.schemas import PromptSettings
from core.errors import UsageError
from core.support.inputs import check
from plugins.fitness.perturbation_range import PerturbationRange


@pytest.mark.parametrize(
    ("setting", "value", "message"),
    [
        ("position", -0.001, "must be greater than or equal to 0, got -0.001"),
        ("yaw", math.inf, "must be a finite number, got inf"),
        ("mass", 1.0, "must be less than 1, got 1.0"),
        ("friction", math.nan, "must be .*, got nan"),
    ],
)
def test_ranges_that_are_refused(setting, value, message):
    with pytest.raises(UsageError, match=f"perturbation: {setting}: {message}"):
        check(PerturbationRange, {setting: value}, "perturbation", UsageError)


def test_prompts_share_no_list():
    one, other = PromptSettings(), PromptSettings()
    one.initial.clear()
    assert other.initial
