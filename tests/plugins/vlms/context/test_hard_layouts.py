"""In which further layouts all fail, and what they have in common."""

from dataclasses import replace

import pytest

from core.config.schemas import PromptSettings
from core.designs.composer import PromptComposer
from core.designs.prompt_values import RunFacts
from core.interfaces import Observation, Trial
from core.plugins import PluginPart
from core.scene import Camera
from core.trial import Held, Tally, Where
from core.values.observations import Sight
from plugins.vlms.context.causes import cause_lines
from plugins.vlms.context.hard_layouts import find_hard_layouts
from plugins.vlms.context.sight import Hidden
from tests.support.briefs import make_brief, make_elite

WIDE = PluginPart("task", "BringCube", (("variation", "wide"),)).shared()
NEAR = [n for n in range(300) if WIDE.draw(n)("cube.x", 0) < 0.88]


def elite(number, failing, among=range(300), outcome="missed cube"):
    """An elite that fails in these further layouts."""
    trials = [
        Trial(
            Where("BringCube", "mujoco", n),
            reward=float(n not in failing),
            solved=n not in failing,
            outcome=outcome if n in failing else "",
        )
        for n in among
    ]
    tally = Tally(
        {trial.layout: (trial,) for trial in trials},
        {trial.layout: {"mujoco": 1 - trial.reward} for trial in trials},
    )
    return replace(make_elite(number, 1.0), finals=tally)


def prompt(*elites, tried=(), **settings):
    composer = PromptComposer(RunFacts(PromptSettings(**settings), judged="layouts"))
    brief = make_brief(task=WIDE, elites=elites, tried=tried)
    (_, user) = composer.compose(brief)
    return "".join(part.text for part in user.parts)


def test_a_layout_is_hard_where_several_were_tried_and_none_held():
    found = find_hard_layouts([elite(0, [1, 3]), elite(1, [0, 1], range(3))])
    assert {layout: len(trials) for layout, trials in found.items()} == {1: 2}
    assert find_hard_layouts([elite(0, [1, 3])]) == {}
    assert find_hard_layouts([elite(0, [1, 3]), elite(0, [1])]) == {}  # one design


def test_the_prompt_says_first_where_all_fail_with_the_numbers_that_are_alike_there():
    text = prompt(elite(0, NEAR), elite(1, [*NEAR, 1]))
    assert f"fail in layouts {NEAR[0]}, {NEAR[1]}," in text
    assert "- missed cube (in" in text
    low, high = WIDE.ranges["cube.x"]
    assert f" there, of {low:.4g} to {high:.4g}" in text
    assert text.index("fail in layouts") < text.index('"g0-a0-s0-p0"')
    assert f"holds in {300 - len(NEAR)} of 300 further layouts" in text
    assert '"layout": 1, ' in text.replace("\n", " ")


def test_of_others_that_were_tried_is_learnt_too_and_nothing_where_one_holds():
    assert "fail in layout 5." in prompt(elite(0, [5]), tried=(elite(1, [5]),))
    assert "fail in" not in prompt(elite(0, [5]), tried=(elite(1, [6]),))


def seen_off(trial, x):
    seen = Observation("missed", "cube", left=("cube",), errors={"cube": (x, None, 0)})
    return replace(trial, observation=seen)


def test_an_elite_is_told_why_it_fails_how_often_and_which_way():
    failing = elite(0, [3, 8], range(24))
    for layout, x in ((3, 0.01), (8, 0.03)):
        (trial,) = failing.finals.trials[layout]
        failing.finals.trials[layout] = (seen_off(trial, x),)

    text = prompt(failing)
    assert "holds in 22 of 24 further layouts" in text
    assert (
        "in 2 of the 2 where it fails: missed cube, on the mean off by (0.02, -, 0), "
        "10 to 30 mm away (layouts 3, 8)"
    ) in text


@pytest.mark.parametrize(
    ("near", "far", "said"),
    [(0.009, 0.009, "millimetres"), (0.011, 0.099, "centimetres"), (0.09, 0.11, None)],
)
def test_without_numbers_a_miss_has_its_scale(near, far, said):
    failing = elite(0, [3, 8], range(24))
    for layout, x in ((3, near), (8, far)):
        (trial,) = failing.finals.trials[layout]
        failing.finals.trials[layout] = (seen_off(trial, x),)

    (line,) = cause_lines(failing, Hidden(("cube",), Camera()))
    scale = said or "centimetres to decimetres"
    assert f"missed cube, on the mean off by +x, {scale} away (layouts 3, 8)" in line


def test_causes_that_differ_in_numbers_count_together_the_commonest_first():
    failing = elite(0, [1, 2, 5], range(24))
    causes = {
        1: "missed cube",
        2: "forbidden: board pressed with 21 N, 15 N allowed",
        5: "forbidden: board pressed with 15.2 N, 15 N allowed",
    }
    for layout, cause in causes.items():
        (trial,) = failing.finals.trials[layout]
        failing.finals.trials[layout] = (replace(trial, outcome=cause),)

    first, second = cause_lines(failing, Sight())
    assert first.startswith("in 2 of the 3 where it fails: forbidden: board pressed")
    assert first.endswith("(layouts 2, 5)")
    assert second == "in 1 of the 3 where it fails: missed cube (layout 1)"


def test_changes_of_one_layout_are_named_by_their_own_numbers():
    """A candidate that holds in a layout fails in two of four small changes of it, in one in an engine alone."""
    trials = {}
    for change in range(4):
        where = Where("BringCube", "mujoco", 0, change)
        other = Where("BringCube", "sapien", 0, change)
        here = Trial(where, reward=0.9, solved=change != 2, outcome="missed cube")
        there = Trial(other, reward=0.8, solved=change != 3, outcome="missed cube")
        trials[change] = (here, there)

    losses = {change: {"mujoco": 0.1, "sapien": 0.2} for change in trials}
    failing = replace(make_elite(0, 1.0), finals=Tally(trials, losses))
    assert failing.finals.count_held() == Held(2, 4)
    assert cause_lines(failing, Sight()) == [
        "in 2 of the 2 where it fails: missed cube (changes 2, 3)"
    ]
    assert (
        find_hard_layouts([failing, replace(failing, candidate=elite(1, []).candidate)])
        == {}
    )
    text = prompt(failing)
    assert "holds in 2 of 4 small changes of the scene" in text
