import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.errors import UsageError
from core.values.layouts import Draw, around
from tasks.dislodge_cube import DislodgeCube

RANGES = {**around("cube", (0.5, 0.1, 0.0), 0.1, 0.2), "cube.mass": (1.0, 2.0)}


@given(seed=st.integers(0, 2**40))
def test_a_number_is_in_its_range_and_depends_on_seed_and_name_alone(seed):
    draw = Draw(RANGES, seed)
    drawn = {name: draw(name, 9.0) for name in RANGES}
    assert all(
        RANGES[name][0] <= value <= RANGES[name][1] for name, value in drawn.items()
    )
    assert {
        name: Draw({name: RANGES[name]}, seed)(name, 9.0) for name in reversed(RANGES)
    } == drawn
    assert len(set(drawn.values())) == len(drawn)


def test_what_has_no_range_keeps_its_value():
    pose = Draw({"cube.y": (3.0, 3.0)}, 0).pose("cube", (1.0, 2.0, 0.5))
    assert (*pose.position, *pose.rpy) == (1.0, 3.0, 0.5, 0.0, 0.0, 0.0)


def test_a_task_without_variations_takes_none_alone():
    class Plain(DislodgeCube):
        variations = {}  # noqa: RUF012

    assert Plain().variation == "none"
    with pytest.raises(UsageError, match="possible: none"):
        Plain("wide")
