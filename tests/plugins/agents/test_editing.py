"""A design that was tried is changed by the paths that differ."""

import pytest

from plugins.agents.bench import Refused
from plugins.agents.editing import change_design, list_differences

DESIGN = {
    "tool_name": "rake",
    "tool_components": [
        {"name": "stem", "size": [0.1, 0.2]},
        {"name": "blade", "size": [0.3, 0.4]},
    ],
    "action_sets": [[[0.5, 0.0], {"anchor": "cube", "offset": [0, 0, 0.1]}]],
}


def test_values_are_changed_by_their_places_and_the_design_stays():
    changed = change_design(
        DESIGN,
        {
            "tool_components.blade.size.1": 0.7,
            "tool_components.0.size": [1, 2],
            "action_sets.0.1.offset.2": 0.2,
            "action_sets.0.1.speed": 0.3,
        },
    )
    stem, blade = changed["tool_components"]
    assert (stem["size"], blade["size"]) == ([1, 2], [0.3, 0.7])
    step = {"anchor": "cube", "offset": [0, 0, 0.2], "speed": 0.3}
    assert changed["action_sets"] == [[[0.5, 0.0], step]]
    assert DESIGN["tool_components"][0]["size"] == [0.1, 0.2]
    assert change_design(DESIGN, {}) == DESIGN


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        ("tool_component.0.size", "did you mean 'tool_components'"),
        ("tool_components.fin.size", "'fin' is none of 0 to 1 or stem, blade"),
        ("action_sets.0.2.0", "'2' is none of 0 to 1$"),
        ("action_sets.0.-1.0", "'-1' is none of 0 to 1$"),
        ("tool_name.0", "there is nothing below rake"),
        ("action_sets.0.0.0.0", "there is nothing below 0.5"),
    ],
)
def test_a_place_that_is_not_there_is_named(place, reason):
    with pytest.raises(Refused, match=reason):
        change_design(DESIGN, {place: 1})


def test_two_designs_are_compared_place_by_place():
    change = {"tool_components.blade.size.1": 0.7, "action_sets.0.1.speed": 0.3}
    assert list_differences(DESIGN, change_design(DESIGN, change)) == [
        "tool_components.1.size.1: 0.4 -> 0.7",
        "action_sets.0.1.speed: null -> 0.3",
    ]
    assert list_differences(DESIGN, DESIGN) == []
