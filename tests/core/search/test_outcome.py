"""What a run says of its winner: what a second engine has a word in, and when it is done."""

import json

import pytest

from core.config.compose import load
from core.hooks import hookimpl
from core.search.orchestration import run
from core.search.outcome import print_best
from core.store.rows import Best, ElsewhereFigures
from core.trial import Trial, Where, best_first
from plugins.conformance.evaluations import tried_once
from tests.core.test_design import ok


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
    other = ElsewhereFigures("sapien", there, here)
    print_best(Best(1.0, 0, "g0-a0-s0-p0", elsewhere=other), tmp_path)
    assert capsys.readouterr().out.startswith(first)


class Doubter:
    """Says what a second engine made of the winner, and looks at what is written then."""

    @hookimpl
    def winner_chosen(self, run, result):
        self.written = [path.name for path in run.folder.glob("best/*")]
        where = Where(run.task.name, "other", run.seed)
        reward = result.best.reward - 0.2
        return Trial(where, result.best.candidate.id, reward=reward)


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_a_second_engine_has_its_word_before_the_winner_is_written(tmp_path):
    words = "task=BringCube sim=mujoco listener=[] film=false prompt.picture=false budget.final_s=0 budget.elite_s=0"
    sizes = "budget.n_agent=1 budget.n_tool=3 budget.n_action=1 budget.n_iteration=0"
    doubter = Doubter()
    config = load("config", [*words.split(), *sizes.split()])
    result = run(config, tmp_path / "run", listeners=[doubter])
    assert result.best is not None
    assert doubter.written == []
    best = json.loads((tmp_path / "run" / "result.json").read_text())["best"]
    assert best["elsewhere"] == {
        "engine": "other",
        "reward": best["reward"] - 0.2,
        "here": best["reward"],
        "solved": False,
    }


def test_of_designs_that_earn_alike_the_solved_one_goes_first():
    short = ok(0.999, 0.5, (0, 0, 0, 1))
    solved = ok(0.998, 2.0, (0, 0, 0, 2))
    solved = tried_once(solved.candidate, "ok", reward=0.998, solved=True)
    assert best_first([short, solved]) == [solved, short]
    assert best_first([short, solved], tie=0.0) == [short, solved]
