import pytest

from core.designs.arm_sheet import describe_arm, describe_exactness, describe_speed, segments
from core.interfaces import RolloutSettings, Task
from tests.panda import PANDA


def test_how_exact_the_arm_is_depends_on_the_engine():
    measured = PANDA.measured
    texts = [describe_arm(Task.home, RolloutSettings(), engine).exactness for engine in ("mujoco", "sapien", "mine")]
    assert f"Measured in mujoco: in motion it lags by up to {measured['mujoco']['lag_mm']:.2g} mm" in texts[0]
    assert f"presses with {measured['sapien']['push_n_per_mm']:.0f} N per mm, " in texts[1]
    lags = [figures["lag_mm"] for figures in measured.values()]
    assert (
        f"Measured in {len(lags)} engines: in motion it lags by up to {min(lags):.2g} to {max(lags):.2g} mm" in texts[2]
    )
    assert "N per mm or full force at once" in texts[2]


def test_of_an_arm_that_was_never_measured_nothing_is_said():
    assert describe_exactness({}, "mujoco") == ""


def test_segments_take_the_time_of_the_motion():
    """Without limits the profile is a trapezoid: its peak is 1.25 times its mean."""
    slow = segments(Task.home, RolloutSettings(segment_s=3.0))
    assert [one.seconds for one in slow] == pytest.approx([3.0] * len(slow), rel=0.01)
    assert [one.peak for one in slow] == pytest.approx([1.25] * len(slow), rel=0.02)
    fast = {(one.way, one.length): one for one in segments(Task.home, RolloutSettings())}
    assert fast["forward", 0.4].seconds > fast["left", 0.4].seconds > fast["left", 0.1].seconds
    assert fast["forward", 0.4].peak > 1.5
    assert "for 0.1 m" in describe_speed(PANDA, slow)
