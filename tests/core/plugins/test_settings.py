import pytest

from core.errors import UsageError
from tests.core.plugins.offering import Engine, Offering


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"grid": 1, "timestep": 1}, r"'timestep' in sim=grid \(did you mean 'time_step'\?\); possible: grid, ti"),
        ({"time_step": 0.1}, "sim=grid: setting 'grid' is needed; settings: grid, time_step, walls"),
        ({"grid": 1, "time_step": "fast"}, "sim=grid: setting 'time_step' can't be 'fast': must be a number"),
        ({"grid": 1.5}, "sim=grid: setting 'grid' can't be 1.5: .*integer"),
        ({"grid": 1, "walls": "north"}, "sim=grid: setting 'walls' can't be 'north': .*list"),
        ({"grid": None}, "sim=grid: setting 'grid' can't be None"),
    ],
)  # fmt: skip
def test_settings_are_checked_against_the_signature(found, settings, reason):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    with pytest.raises(UsageError, match=reason) as error:
        found.create("sim", "grid", settings)
    assert "\n" not in str(error.value)


def test_what_the_program_gives_is_no_setting(found):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    with pytest.raises(
        UsageError, match="no setting 'grid' in sim=grid; possible: time_step, walls"
    ):
        found.create("sim", "grid", {"grid": 1}, grid=2)
