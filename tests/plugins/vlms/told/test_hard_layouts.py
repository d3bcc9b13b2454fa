"""In which further layouts all fail, and what they have in common."""

from dataclasses import replace

from core.config.schemas import PromptSettings
from core.designs.composer import PromptComposer
from core.designs.prompt_values import RunFacts
from core.interfaces import Trial
from core.plugins import PluginPart
from core.trial import Tally, Where
from plugins.vlms.told.hard_layouts import find_hard_layouts
from tests.core.designs.test_composer import make_brief, make_elite

WIDE = PluginPart("task", "BringCube", (("variation", "wide"),)).shared()
NEAR = [n for n in range(300) if WIDE.draw(n)("cube.x", 0) < 0.88]


def elite(number, failing, among=range(300), outcome="missed cube"):
    """An elite that fails in these further layouts."""
    trials = [
        Trial(Where("BringCube", "mujoco", n), reward=float(n not in failing))
        for n in among
    ]
    trials = [replace(t, outcome="" if t.reward else outcome) for t in trials]
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
