"""MAP-Elites: elites of different kinds are shown."""

import json

import numpy as np
import pytest
from omegaconf import OmegaConf

from core.design import Candidate
from core.errors import UserError
from core.interfaces import Budget
from core.plugins import installed
from core.search.orchestration import resume, run
from core.trial import best_first
from plugins.conformance.evaluations import tried_once
from tests.core.run_folders import hook
from tests.support import toys
from tests.support.runs import assert_same_run

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


def config(toy, fails_at=None):
    cfg = toys.config(toy.file, *WORDS)
    OmegaConf.update(cfg, "executor.fails_at", fails_at, force_add=True)
    return cfg


@pytest.mark.thorough
def test_an_interrupted_run_comes_to_the_same_archive(toy, tmp_path):
    run(config(toy), tmp_path / "whole")
    tried = len(toy.lines("tried"))
    assert (
        len(
            json.loads((tmp_path / "whole/archive/designs.json").read_text())[
                "strategies"
            ]
        )
        > 3
    )
    for at in (2, 4, 6):
        folder = tmp_path / str(at)
        assert run(config(toy, fails_at=at), folder).stopped == "interrupted"
        resume(folder, ["executor.fails_at=null"])
        assert_same_run(folder, tmp_path / "whole")
    assert len(toy.lines("tried")) == 4 * tried
