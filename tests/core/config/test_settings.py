import math

import pytest

from core.config.schemas import PromptSettings
from core.errors import UsageError
from plugins.fitness.perturbation_range import PerturbationRange


@pytest.mark.parametrize(
    ("setting", "value", "message"),
    [
        (
            "position",
            -0.001,
            "perturbation.position must be 0 or greater, and finite, got -0.001",
        ),
        ("yaw", math.inf, "perturbation.yaw must be 0 or greater, and finite, got inf"),
        (
            "mass",
            1.0,
            "perturbation.mass must be 0 or greater and less than 1, got 1.0",
        ),
        (
            "friction",
            math.nan,
            "perturbation.friction must be 0 or greater and less than 1, got nan",
        ),
    ],
)
def test_ranges_that_are_refused(setting, value, message):
    with pytest.raises(UsageError, match=message):
        PerturbationRange(**{setting: value})


def test_prompts_share_no_list():
    one, other = PromptSettings(), PromptSettings()
    one.initial.clear()
    assert other.initial
