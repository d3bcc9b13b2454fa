"""MAP-Elites: elites of different kinds are shown."""

import json

import numpy as np
import pytest

from core.design import Candidate
from core.errors import UserError
from core.interfaces import Budget
from core.plugins import installed
from core.search.orchestration import run
from core.trial import best_first
from plugins.conformance.evaluations import tried_once
from tests.core.run_folders import hook
from tests.support import toys

BUDGET = Budget(2, 4, 1, 3, 3, 0.0, k_least=0)


class Hooks:
    """A designer of longer and longer hooks."""

    def __init__(self, seed=0):
        self.seed, self.shown = seed, []

    def design(self, generation, elites=()):
        self.shown.append([elite.candidate.id for elite in elites])
        for strategy in range(8):
            plan = np.full((1 + strategy % 2, 6), 0.1 * strategy)
            yield Candidate(hook(0.2 + 0.04 * strategy), plan, generation, 0, strategy)


def search(designer, generations=3, earns=lambda c: 0.1 + 0.1 * c.design, **settings):
    """The evaluations of each generation."""
    strategy = installed().create(
        "evolution", "map_elites", settings, designer=designer, budget=BUDGET
    )
    found = []
    for _ in range(generations):
        candidates = sorted(strategy.ask(), key=lambda c: c.key)
        found.append(
            [
                tried_once(
                    c,
                    "ok" if c.problem is None else "rejected",
                    reward=min(earns(c), 1.0),
                    distance_m=1.0,
                )
                for c in candidates
            ]
        )
        strategy.tell(found[-1])
    return found


def test_the_best_and_others_of_different_cells_are_shown():
    shown = set()
    for seed in range(20):
        designer = Hooks(seed)
        tried = [e for generation in search(designer, 2) for e in generation]
        first, then = designer.shown
        assert first == []
        assert len(set(then)) == BUDGET.k_top
        ranks = [e.candidate.id for e in best_first(tried[:8])]
        assert then[0] == ranks[0]
        assert then == sorted(then, key=ranks.index)
        shown |= set(then)
    assert len(shown) > 5  # of 8


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"measures": ["weight"]}, "no measure 'weight'"),
        ({"measures": 3}, "setting 'measures' can't be 3"),
    ],
)
def test_wrong_settings(settings, message):
    with pytest.raises(UserError, match=message):
        search(Hooks(), **settings)


# --- whole runs -------------------------------------------------------------------------------------------------

WORDS = ("evolution=map_elites", "budget.n_iteration=2")


@pytest.mark.thorough
def test_a_run_writes_its_archive(toy, tmp_path):
    """`tests/test_resume.py` cuts such runs short."""
    run(toys.config(toy.file, *WORDS), tmp_path / "whole")
    archive = json.loads((tmp_path / "whole/archive/designs.json").read_text())
    assert len(archive["strategies"]) > 3
