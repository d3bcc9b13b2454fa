"""What a run says of its winner: what a second engine has a word in, and when it is done."""

import json

import pytest

from core.config.compose import load
from core.errors import UserError
from core.search.orchestration import run
from core.search.outcome import print_best
from core.simulation.play import play
from core.store.rows import Best, SecondEngineFigures
from core.trial import Making, best_first
from plugins.conformance.evaluations import tried_once
from tests.support.evaluations import ok


@pytest.mark.parametrize(
    ("there", "here", "first"),
    [
        (0.3, 1.0, "best reward 1.000, but 0.300 in sapien, "),
        (0.899, 1.0, "best reward 1.000, but 0.899 in sapien, "),
        (0.901, 1.0, "best reward 1.000, candidate "),
        (0.5, 0.4, "best reward 1.000, candidate "),
        (0.55, 0.4, "best reward 1.000, but 0.550 in sapien where it earned 0.400, "),
    ],
)
def test_the_first_line_has_a_second_engine_that_differs_by_more_than_a_tenth(
    there, here, first, tmp_path, capsys
):
    other = SecondEngineFigures("sapien", there, here)
    print_best(Best(1.0, 0, "g0-a0-s0-p0", second_engine=other), tmp_path)
    assert capsys.readouterr().out.startswith(first)


@pytest.mark.parametrize(
    ("making", "makeable", "said"),
    [
        (
            Making(False, "printable: no (it is a loop)", "it is a loop"),
            "g0-a1-s0-p0",
            ", but it can't be built and run (it is a loop; g0-a1-s0-p0 can), ",
        ),
        (
            Making(False, "printable: no (it is a loop)", "it is a loop"),
            None,
            ", but it can't be built and run (it is a loop), ",
        ),
        (Making(True, "printable: yes"), None, "1.000, candidate "),
        (Making(None, "printable: not known"), None, "1.000, candidate "),
    ],
)
def test_the_first_line_says_why_the_winner_can_not_be_made_and_which_can(
    making, makeable, said, tmp_path, capsys
):
    print_best(Best(1.0, 0, "g0-a0-s0-p0", making=making, makeable=makeable), tmp_path)
    assert said in capsys.readouterr().out.splitlines()[0]


WORDS = (
    "task=BringCube sim=mujoco listener=[] film=false prompt.picture=false budget.final_s=0 budget.elite_s=0 "
    "budget.n_agent=1 budget.n_tool=3 budget.n_action=1 budget.n_iteration=0"
)


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
@pytest.mark.parametrize(
    ("second", "engine"), [("[mujoco,pybullet,sapien]", "pybullet"), ("[]", "")]
)
def test_a_second_engine_has_its_word_before_the_winner_is_written(
    second, engine, tmp_path, monkeypatch
):
    """Whoever listens: what the run stores has it."""
    written = []

    def watched(condition, candidates):
        written.extend(path.name for path in tmp_path.glob("run/best/*"))
        return play(condition, candidates)

    monkeypatch.setattr("core.search.second_engine.play", watched)
    config = load("config", [*WORDS.split(), f"second={second}"])
    result = run(config, tmp_path / "run")
    assert written == []
    best = json.loads((tmp_path / "run" / "result.json").read_text())["best"]
    if not engine:
        assert best["second_engine"] is result.second_engine is None
        return

    assert result.second_engine is not None
    assert best["second_engine"] == {
        "engine": engine,
        "reward": result.second_engine.reward,
        "here": best["reward"],
        "solved": result.second_engine.solved,
    }


def test_a_second_engine_that_nobody_offers_is_refused_before_anything_is_asked(
    tmp_path,
):
    config = load("config", [*WORDS.split(), "second=[mujoko]"])
    with pytest.raises(UserError, match="mujoko"):
        run(config, tmp_path / "run")


def test_of_designs_that_earn_alike_the_solved_one_goes_first():
    short = ok(0.999, 0.5, (0, 0, 0, 1))
    solved = ok(0.998, 2.0, (0, 0, 0, 2))
    solved = tried_once(solved.candidate, "ok", reward=0.998, solved=True)
    assert best_first([short, solved]) == [solved, short]
    assert best_first([short, solved], tie=0.0) == [short, solved]
