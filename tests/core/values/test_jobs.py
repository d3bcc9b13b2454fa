import numpy as np
import pytest

from core.errors import UsageError
from core.interfaces import JointTrajectory, RolloutSettings


def test_targets_are_linear_between_instants_and_constant_outside():
    arm = np.outer([0.0, 1.0, 1.0], np.arange(7))
    trajectory = JointTrajectory(
        np.array([0.0, 2.0, 3.0]), arm, np.array([0.04, 0.0, 0.02])
    )
    assert trajectory.duration == 3
    joints, fingers = trajectory.sample(np.array([-1.0, 0.5, 2.5, 9.0]))
    np.testing.assert_allclose(joints, np.outer([0, 0.25, 1, 1], np.arange(7)))
    np.testing.assert_allclose(fingers, [0.04, 0.03, 0.01, 0.02])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"segment_s": 0}, "rollout.segment_s must be greater than 0, got 0"),
        (
            {"max_motion_s": float("nan")},
            "rollout.max_motion_s must be greater than 0, got nan",
        ),
        ({"hold_s": 61}, "rollout.hold_s must be between 0 and 60 seconds, got 61"),
        (
            {"settle_s": -0.1},
            "rollout.settle_s must be between 0 and 60 seconds, got -0.1",
        ),
        (
            {"speed": 1.1},
            "rollout.speed is a share of the arm's limits, at most 1, got 1.1",
        ),
        (
            {"penetration": "forbidden"},
            r"no rollout.penetration 'forbidden' \(did you mean 'forbid'\?\)",
        ),
    ],
)
def test_settings_that_are_refused(settings, message):
    with pytest.raises(UsageError, match=message):
        RolloutSettings(**settings)
