import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator, make_interp_spline

from core.robot.kinematics import arm_of
from core.robot.paths import join_knots
from tests.support.panda import PANDA

ARM = arm_of(PANDA)


@pytest.mark.parametrize("count", [*range(2, 12), 40, 200])
def test_a_path_is_scipys_spline_to_the_last_bit(count):
    drawn = np.random.default_rng(count).uniform(0.3, 0.7, (count, len(ARM.home)))
    knots = ARM.lower + drawn * (ARM.upper - ARM.lower)
    path = join_knots(knots, ARM)
    expected = make_interp_spline(np.linspace(0, 1, count), knots, min(3, count - 1))
    places = np.linspace(0, 1, 301)
    for order in range(3):
        assert np.array_equal(path(places, order), expected(places, order))


def test_a_path_at_its_limit_does_not_overshoot():
    knots = np.repeat(ARM.home[None], 4, axis=0)
    knots[1:3, 0] = ARM.upper[0]
    path = join_knots(knots, ARM)
    assert isinstance(path, PchipInterpolator)
    assert path(np.linspace(0, 1, 301))[:, 0].max() <= ARM.upper[0]
