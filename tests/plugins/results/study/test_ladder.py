"""``vlmgineer study ladder``: which rungs count, when a climb ends, and what is said of it."""

import json
from types import SimpleNamespace

import pytest

from core.errors import UsageError
from plugins.results.study.ladder import admission, climbing
from plugins.results.study.ladder.admission import admit
from plugins.results.study.ladder.climbing import (
    draw,
    list_families,
    list_steps,
    main,
    score,
    tabulate,
)
from plugins.results.study.ladder.staircase import Staircase, Step, highest
from plugins.results.study.running import Runner
from tests.support.text import read_csv

WORDS = [
    *("task=ladder", "task.family=tunnel", "task.level=1", "task.seed=0"),
    *("protocol=ladder", "tool=boxes", "designs=none", "fitness.layouts=2"),
    *("protocol.engines=[mujoco]", "sim=mujoco", "executor.workers=1"),
]


def climb(held, most=9, drawn=True):
    """Climb with a method that holds at some levels; return the steps."""

    class Fake(Staircase):
        def _draw(self, level):
            return (0, "") if drawn else (None, "it takes no thought")

        def _run(self, level, drawn, runner):
            return Step(self.family, level, self.seed, drawn, held=level in held)

    stairs = Fake("sort", 0, 1, "m", None, (), most)
    return list(stairs.climb(Runner([])))


@pytest.mark.parametrize(
    ("held", "levels", "top"),
    [
        ((), 2, 0),
        ((1,), 3, 1),
        ((1, 3), 5, 3),  # one failure is no end
        ((1, 4), 3, 1),  # two are
        (range(1, 99), 9, 9),
    ],
)
def test_a_climb_ends_after_two_levels_that_fail(held, levels, top):
    steps = climb(held)
    assert len(steps) == levels
    assert highest(steps) == top


def test_a_climb_ends_where_no_scene_counts():
    (step,) = climb(range(9), drawn=False)
    assert (step.drawn, step.held, step.remark) == (None, False, "it takes no thought")


def steps(**levels):
    made = []
    for family, tops in levels.items():
        for seed, top in enumerate(tops):
            for level in range(1, top + 3):
                step = Step(
                    family,
                    level,
                    seed,
                    0,
                    held=level <= top,
                    shares=(("mujoco", 1.0 if level <= top else 0.5),),
                    requests=2,
                    tokens=100 if family == "sort" else None,
                    rollouts=40,
                    seconds=36.0,
                )
                made.append(step)

    return made


def test_the_table_has_levels_means_intervals_and_what_they_took():
    found = steps(sort=[3, 4, 5], tunnel=[0, 0, 3])
    assert score(found) == {"sort": [3, 4, 5], "tunnel": [0, 0, 3]}
    sort, tunnel, mean = tabulate(found).rows
    assert sort[:3] == ("sort", "3 4 5", 4.0)
    assert 3.0 <= sort[3] < 4.0 < sort[4] <= 5.0
    assert sort[5:] == (36.0, 1800.0, 720.0, pytest.approx(0.18))
    assert tunnel[:3] == ("tunnel", "0 0 3", 1.0)
    assert tunnel[6] is None
    assert mean[:3] == ("mean", "", 2.5)
    assert mean[5] == 54.0
    assert len(list_steps(found).rows) == len(found)


def test_the_figure_is_the_same_each_time():
    levels = {"sort": [3, 4, 5], "tunnel": [0, 0, 3]}
    first = draw("m", levels).render("png")
    assert first.startswith(b"\x89PNG")
    assert draw("m", levels).render("png") == first


def test_families_are_those_of_the_task():
    assert {"places", "sort", "tunnel"} <= {*list_families()}


@pytest.mark.slow
def test_a_rung_counts_by_what_is_tried_and_is_tried_once(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    file = tmp_path / "rungs" / "tunnel.json"
    words = [*WORDS, "fitness.sims=${protocol.engines}"]
    found = admit(words, file)
    assert found.refused == ""
    assert found.reference == {"mujoco": 1.0}
    assert found.simpler == {"mujoco": 0.0}
    assert found.waiting == 0.0
    assert "Tunnel1Seed0" in file.with_suffix(".yaml").read_text()

    def played(*_):
        raise AssertionError("it was played again")

    monkeypatch.setattr(admission, "try_all", played)
    assert admit(words, file) == found
    other = [w.replace("level=1", "level=2") for w in words]
    with pytest.raises(AssertionError, match="again"):
        admit(other, file)


def tried(shares, status="ok"):
    """What came of a design that holds in such shares of 20 layouts, by engine."""
    trials = []
    for engine, share in shares.items():
        for number in range(20):
            reward = 1.0 if number < round(20 * share) else 0.0
            trials.append(SimpleNamespace(engine=engine, reward=reward))

    return SimpleNamespace(trials=trials, status=status, reason="it is too long")


BOTH = {"mujoco": 1.0, "sapien": 1.0}
NONE = {"mujoco": 0.0, "sapien": 0.0}


@pytest.mark.parametrize(
    ("reference", "simpler", "waiting", "refused"),
    [
        (BOTH, NONE, NONE, ""),
        ({"mujoco": 0.95, "sapien": 1.0}, NONE, NONE, ""),
        ({"mujoco": 0.9, "sapien": 1.0}, NONE, NONE, "the reference holds in 90 %"),
        (BOTH, {"mujoco": 0.9, "sapien": 1.0}, NONE, ""),
        (BOTH, {"mujoco": 0.95, "sapien": 1.0}, NONE, "the simpler design holds"),
        (BOTH, {}, NONE, ""),
        ({}, NONE, NONE, "the reference was rejected: it is too long"),
        (BOTH, NONE, {"mujoco": 0.05, "sapien": 0.0}, "waiting earns 1"),
    ],
)
def test_a_rung_counts_if_it_can_be_solved_and_takes_thought(
    reference, simpler, waiting, refused
):
    found = admission._judge("sum", list(map(tried, (reference, simpler, waiting))))
    assert found.refused.startswith(refused)
    assert bool(found.refused) == bool(refused)


def test_a_climb_draws_another_scene_where_one_does_not_count(tmp_path, monkeypatch):
    tried = []

    def refuse(words, file):
        tried.append((words, file.name))
        good = "task.seed=7" in words
        return admission.Admission("", "" if good else "no", {}, {}, 0.0)

    monkeypatch.setattr("plugins.results.study.ladder.staircase.admit", refuse)
    words = ("vlm=offline", "robot=ur5", "protocol.engines=[mujoco]")
    stairs = Staircase("sort", 1, 3, "m", tmp_path, words, 9)
    assert stairs._draw(2) == (7, "")
    names = [name for _, name in tried]
    assert names == [f"sort_2_seed{drawn}.json" for drawn in (1, 4, 7)]
    assert {"robot=ur5", "protocol.engines=[mujoco]"} <= {*tried[0][0]}
    assert "vlm=offline" not in tried[0][0]

    other = Staircase("sort", 2, 3, "m", tmp_path, words, 9)
    assert other._draw(2) == (None, "no")
    assert len(tried) == 3 + 4


def test_words_that_differ_are_refused_for_runs_that_are_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Staircase, "climb", lambda *_: steps(tunnel=[1]))
    words = ["families=tunnel", "seeds=1", "name=mine"]
    main([*words, "vlm=offline"])
    main([*words, "vlm=offline", "executor.workers=1"])  # which changes no result
    rows = read_csv(tmp_path / "studies/ladder/mine/ladder.csv")
    assert [row["family"] for row in rows] == ["tunnel", "mean"]
    noted = json.loads((tmp_path / "studies/ladder/mine" / climbing.WORDS).read_text())
    assert "vlm=offline" in noted
    with pytest.raises(UsageError, match=r"budget\.n_agent"):
        main([*words, "vlm=offline", "budget.n_agent=5"])


def test_what_is_no_family_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError, match="family"):
        main(["families=none"])


@pytest.mark.thorough
def test_the_embedded_designer_climbs_and_goes_on(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["vlm=offline", "families=tunnel", "seeds=1", "most=1"]
    words += ["executor.workers=1", "protocol.engines=[mujoco]"]
    main(words)
    first = capsys.readouterr()
    assert "tunnel seed 0 level 1" in first.err
    main(words)
    assert capsys.readouterr().out == first.out
