"""The lines about a generation, and what is said of elites."""

import json
from dataclasses import replace

import pytest

from core.config.schemas import PromptSettings
from core.designs.composer import PromptComposer
from core.designs.prompt_values import RunFacts
from core.interfaces import Contact
from core.scene import Camera
from core.trial import Tally, Where
from core.values.margins import Margin
from core.values.observations import Moved
from plugins.vlms.context.feedback import elite_feedback, generation_lines, trial_lines
from plugins.vlms.context.sight import Hidden
from tests.support.briefs import make_brief
from tests.support.tried import SEEN, trial, tried, tried_in


def lines(*evaluations, budget=10_000):
    return generation_lines(tuple(evaluations), budget).splitlines()


def test_a_line_of_several_trials_says_what_became_of_each_and_is_about_the_worst():
    near = Margin.clearance("vase", 0.004)
    poor = trial(
        4,
        reward=0.2,
        outcome="forbidden fin touched vase",
        observation=SEEN,
        margins=(near,),
    )
    good = [trial(layout, reward=1.0, outcome="solved") for layout in (3, 5)]
    failed = trial(6, status="failed", reason="it blew up")
    (line,) = lines(tried_in(*good, poor, failed, reward=0.5, shown=2))
    assert line.startswith(
        "- g0-a0-s0-p0: 0.500 (0.000 failed: it blew up in mujoco layout 6; 0.200 forbidden fin touched vase in mujoco "
        "layout 4; 1.000 solved in mujoco layout 3, mujoco layout 5); in mujoco layout 4, least margin: clearance to "
        "vase 0.004 m, limit 0 m: 20 % of the room is left: missed; cube by"
    )
    both = [
        replace(poor, where=poor.where._replace(engine=engine))
        for engine in ("mujoco", "sapien")
    ]
    assert trial_lines(tried_in(*both)) == [
        "0.200 forbidden fin touched vase in all 2 trials"
    ]
    passed = trial(7, reward=0.0, reason="fin passed through lid")
    assert trial_lines(tried_in(passed, passed))[0].startswith("0.000 invalid: fin")


SIGHT = Hidden(("door", "cube", "can", "vase", "cup"), Camera())


def test_margins_are_shares_of_the_room_at_every_level_with_part_and_time():
    margins = (
        Margin.at_most("force on cup", 23.0, 15.0, "N"),
        Margin.clearance("vase", 0.004),
        Margin.at_least("reward", 0.997, 0.95, "", 0.05),
    )
    seen = replace(SEEN, nearest={"vase": ("fin", 2.1)})
    elite = tried_in(trial(observation=seen, margins=margins))
    assert elite_feedback(elite)["margins"] == [
        "force on cup 23 N, limit 15 N: 53 % beyond it",
        "clearance to vase 0.004 m, limit 0 m, fin at 2.10 s: 20 % of the room is left",
    ]
    assert elite_feedback(elite, SIGHT)["margins"] == [
        "force on cup: 53 % beyond it",
        "clearance to vase, fin at 2.10 s: 20 % of the room is left",
    ]
    assert "margins" not in elite_feedback(tried_in(trial(observation=SEEN)))


def test_a_count_that_contradicts_the_reward_is_not_said():
    errors = dict.fromkeys([f"card_{i}" for i in range(13)], (0.1, None, None))
    seen = replace(SEEN, errors=errors, left=("card_0", "card_1"))
    results = {
        reward: elite_feedback(tried(reward=reward, seen=seen))["result"]
        for reward in (12 / 13, 11 / 13, 0.0)
    }
    assert [*results.values()] == ["missed", *["missed, 11 of 13 in place"] * 2]


def test_the_contact_that_matters_is_never_cut():
    """Forty touches of cards come before the one that the result is about."""
    cards = [
        Contact("tool", f"fin_{n}", f"card_{n % 4}", 0.1 * n, 5.0, 0.0)
        for n in range(40)
    ]
    vase = Contact("tool", "stem", "vase", 4.2, 4.3, 0.0)
    errors = dict.fromkeys([f"card_{n}" for n in range(4)], (0.1, None, None))
    seen = replace(
        SEEN,
        result="forbidden",
        what="stem touched vase",
        errors=errors,
        contacts=(*cards, vase),
    )
    contacts = elite_feedback(tried(seen=seen))["contacts"]
    assert contacts[-2] == "stem touched vase at 4.20-4.30 s"
    assert contacts[-1].startswith("33 more, of ")
    assert [line.split()[2] for line in contacts[:4]] == [f"card_{n}" for n in range(4)]
    (line,) = lines(tried(seen=seen))
    assert "stem touched vase at 4.20" in line


def test_a_first_round_has_no_lines():
    assert generation_lines((), 100) == ""


def test_a_line_says_what_happened():
    (line,) = lines(tried())
    assert line == (
        "- g0-a0-s0-p0: 0.500 missed; cube by (-0.3, 0.012, 0), off by (0.1, 0.012, -), tilted 2 deg; "
        "tip touched cube at 1.20-3.40 s, 1.2 mm deep; panda_link7 touched shelf at 2.00-2.20 s, 12.0 N; "
        "way to waypoint 3 missed by 12 mm, 0.02 rad; lag 0.03 rad at 2.10 s (to waypoint 3)"
    )


def test_a_line_says_where_and_when_it_failed():
    still = {"cube": Moved((0.0, 0.0, 0.0), (1.0, 0.0, 0.035), 0.0)}
    stuck = replace(
        SEEN,
        result="stuck",
        what="table",
        at_s=1.25,
        moved=still,
        lag_rad=0.0,
        miss=(1, 0.0, 0.0),
    )
    (line,) = lines(tried(seen=stuck))
    assert (
        "0.500 stuck at table from 1.25 s (to waypoint 2); nothing moved; tip touched"
        in line
    )
    missed = replace(
        stuck,
        result="never touched",
        what="",
        at_s=None,
        contacts=(),
        clearances={"cube": 0.05},
    )
    (line,) = lines(tried(seen=missed))
    assert line.endswith("0.500 never touched, nearest to cube 50 mm")


def test_of_several_bodies_those_that_are_not_in_place_come_first():
    moved = {
        f"dust_{i}": Moved((0.1 * i, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0)
        for i in range(1, 6)
    }
    errors = dict.fromkeys(moved, (0.1, None, None))
    (line,) = lines(
        tried(seen=replace(SEEN, moved=moved, errors=errors, left=("dust_1", "dust_2")))
    )
    assert "missed, 3 of 5 in place; dust_2 by (0.2, 0, 0), off by (0.1, -, -)" in line
    assert "; dust_1 by" in line
    many = replace(SEEN, moved=moved, errors=errors, left=("dust_1", "dust_2"))
    found = elite_feedback(tried(seen=many))
    assert "place" not in found["moved"]["dust_2"]  # it is not
    assert "off by (0.1, -, -) but in place" in found["moved"]["dust_5"]
    assert len(found["moved"]) == 5


def test_what_moved_and_is_no_ones_goal_is_named_at_least():
    moved = {
        f"chip_{i:02}": Moved((0.1 + 0.1 * i, 0.0, 0.0), (1.0, 0.0, 0.0), 0.0)
        for i in range(20)
    }
    found = elite_feedback(tried(seen=replace(SEEN, moved=moved)))["moved"]
    described = [way for way in found.values() if "by (" in way]
    assert len(described) == 4
    (others,) = [name for name, way in found.items() if way == "moved too"]
    assert "chip_15" in others
    assert "chip_00" not in others


def test_rejected_failed_and_invalid_ones_say_why():
    found = lines(
        tried(
            0,
            status="rejected",
            reward=0.0,
            reason="the tool\nstarts inside the arm",
            seen=None,
        ),
        tried(1, status="failed", reward=0.0, reason="the rod broke", seen=None),
        tried(2, reward=0.0, reason="'tip' passed through 'cube'"),
        tried(3, seen=None),
    )
    assert found[0] == "- g0-a0-s0-p3: 0.500"
    (unseen,) = lines(tried(reward=0.0, reason="it passed through", seen=None))
    assert unseen == "- g0-a0-s0-p0: 0.000 invalid: it passed through"
    assert found[1].startswith(
        "- g0-a0-s0-p2: 0.000 invalid: 'tip' passed through 'cube'; cube by"
    )
    assert found[2] == "- g0-a0-s0-p1: failed: the rod broke"
    assert found[3] == "- g0-a0-s0-p0: rejected: the tool starts inside the arm"


def test_of_several_goals_that_count_each_has_its_share_and_no_number_of_a_body():
    half = trial(
        reward=0.5, observation=SEEN, goals=(("door", 0.996), ("cube (goal 1)", 0.0))
    )
    (line,) = lines(tried_in(half))
    assert "0.500 missed; of the goals door 99 %, cube (goal 1) 0 %; cube by" in line
    assert elite_feedback(tried_in(half))["goals"] == {
        "door": "99 %",
        "cube (goal 1)": "0 %",
    }
    hidden = generation_lines((tried_in(half),), 1000, SIGHT)
    assert "of the goals door 99 %, cube (goal 1) 0 %; cube in the picture" in hidden
    assert "off by +x, then +y" in hidden


def test_equal_ones_share_a_line():
    heavy = [
        tried(number, status="rejected", reward=0.0, reason="too heavy", seen=None)
        for number in range(9)
    ]
    (line,) = lines(*heavy)
    assert (
        line
        == "- g0-a0-s0-p0, g0-a0-s0-p1, g0-a0-s0-p2 and 6 more: rejected: too heavy"
    )


def test_what_is_solved_but_fails_in_a_further_layout_is_a_kind_of_its_own():
    solved = replace(SEEN, result="solved")
    many = [tried(n, reward=1.0, seen=replace(solved, lag_s=n / 10)) for n in range(9)]
    failed = trial(reward=0.0, outcome="tipped disc")
    tally = Tally({7: (failed,)}, {7: {"mujoco": 1.0}})
    many.append(replace(tried(9, reward=1.0, seen=solved), finals=tally))

    found = lines(*many, budget=500)
    assert sum("holds in 0 of 1 further layouts" in line for line in found) == 1
    assert found[-1].startswith("- Left out: ")
    assert found[-1].endswith(" solved.")
    missed = replace(tried(1, reward=0.5), finals=tally)
    (_, left) = lines(*many, missed, budget=0)
    assert left.endswith("1 solved but not in all further layouts, 1 missed.")


def test_two_thousand_candidates_keep_to_their_budget_and_every_kind_is_there():
    many = [
        tried(n, reward=n / 2000, seen=replace(SEEN, lag_s=n / 100))
        for n in range(1900)
    ]
    many += [
        tried(1900 + n, reward=0.0, seen=replace(SEEN, result="dropped", lag_s=n / 10))
        for n in range(90)
    ]
    many += [
        tried(1990 + n, status="rejected", reward=0.0, reason=f"rule {n}", seen=None)
        for n in range(10)
    ]
    found = lines(*many, budget=4000)
    assert sum(map(len, found)) < 4200
    assert "g0-a0-s189-p9: 0.950 missed" in found[0]
    marks = {"missed": "missed;", "dropped": "dropped;", "rejected": "rejected:"}
    shown = {
        kind: sum(mark in line for line in found[:-1]) for kind, mark in marks.items()
    }
    assert min(shown.values()) >= 3
    left = found[-1]
    assert left.startswith(
        f"- Left out: {2000 - sum(shown.values())} candidates: {1900 - shown['missed']} missed"
    )
    assert f"{90 - shown['dropped']} dropped" in left
    first = shown["rejected"]
    assert left.endswith(
        f"; {10 - first} times, first g0-a0-s199-p{first}: rule {first}."
    )
    assert lines(*many, budget=0)[1].startswith("- Left out: 1999 candidates")


def test_what_is_said_of_an_elite():
    elite = tried_in(
        replace(trial(observation=SEEN), where=Where("Slide", "mujoco", 0, change=2))
    )
    found = elite_feedback(elite)
    assert found == {
        "result": "missed",
        "moved": {"cube": "by (-0.3, 0.012, 0), off by (0.1, 0.012, -), tilted 2 deg"},
        "arrivals_s": [1.0, 2.0, 3.0],
        "times_s": [0.0, 3.4],
        "path_m": {"cube": "(1, 0, 0.035) (0.7, 0.012, 0.035)"},
        "contacts": [
            "tip touched cube at 1.20-3.40 s, 1.2 mm deep",
            "stem touched cube at 1.50-1.60 s",
            "panda_link7 touched shelf at 2.00-2.20 s, 12.0 N",
        ],
        "clearance_m": {"table": "0.0123 by stem at 1.20 s"},
        "missed": "way to waypoint 3 missed by 12 mm, 0.02 rad",
        "lag": "lag 0.03 rad at 2.10 s (to waypoint 3)",
    }
    assert json.loads(json.dumps(found)) == found


def test_torque_is_not_told_since_engines_count_it_differently():
    assert "torque" not in elite_feedback(tried(torques={"elbow": 1.0}))


def text(feedback, elites=(), **given):
    prompts = PromptComposer(RunFacts(PromptSettings(feedback=feedback, **given)))
    _, user = prompts.compose(make_brief(elites=elites, tried=(tried(), tried(1))))
    return "".join(part.text for part in user.parts)


@pytest.mark.parametrize("elites", [(), (tried(),)])
def test_the_prompt_has_the_lines_unless_it_is_the_papers(elites):
    assert "g0-a0-s0-p1" not in text("paper", elites)
    shown = text("numbers", elites)
    assert "## The last round" in shown
    # An elite stands above.
    names = "g0-a0-s0-p1" if elites else "g0-a0-s0-p0, g0-a0-s0-p1"
    assert f"- {names}: 0.500 missed; cube by" in shown
    assert ("`arrivals_s`" in shown) == bool(elites)


def test_a_first_prompt_has_no_heading_for_a_last_round():
    prompts = PromptComposer(RunFacts(PromptSettings(feedback="numbers")))
    assert "last round" not in "".join(
        part.text for m in prompts.compose(make_brief()) for part in m.parts
    )


def test_ample_room_is_not_told_of_what_missed():
    wide = Margin.at_most("force on board", 0.1, 15.0, "N")
    tight = Margin.at_most("force on lid", 2.0, 15.0, "N")
    missed = trial(reward=0.0, observation=SEEN, margins=(tight, wide))
    (line,) = elite_feedback(tried_in(missed))["margins"]
    assert line.startswith("force on lid")
