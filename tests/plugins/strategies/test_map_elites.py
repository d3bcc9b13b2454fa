"""MAP-Elites: elites of different kinds are shown, and numbers of the archive's members are varied."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from omegaconf import OmegaConf

from core.design import Candidate, Evaluation, best_first
from core.errors import UserError
from core.interfaces import Budget, Numbers, Waypoints
from core.plugins import installed
from core.search.orchestration import Experiment, resume, run
from tests import toys
from tests.core.run_folders import hook
from tests.test_resume import assert_same_run, toy  # noqa: F401 - a fixture

BUDGET = Budget(2, 4, 1, 3, 3, 0.0)


class Hooks:
    """A designer of longer and longer hooks, whose plans vary; those with two waypoints differ from the others."""

    def __init__(self, seed=0, unsound=lambda values: False):
        self.seed, self.unsound, self.shown = seed, unsound, []

    def design(self, generation, elites=()):
        self.shown.append([elite.candidate.id for elite in elites])
        for strategy in range(8):
            plan = np.full((1 + strategy % 2, 6), 0.1 * strategy)
            yield Candidate(hook(0.2 + 0.04 * strategy), plan, generation, 0, strategy)

    def parameters(self, candidate):
        return Numbers.near(candidate.plan.poses, 0.01, 0.7)

    def toward(self, candidate, other):
        same = candidate.plan.poses.shape == other.plan.poses.shape
        return other.plan.poses.ravel() if same else None

    def vary(self, candidate, values, key):
        new = replace(candidate, plan=Waypoints(values.reshape(-1, 6)), parents=(candidate.id,))
        new = replace(new, **dict(zip(("generation", "agent", "strategy", "action"), key, strict=True)))
        return replace(new, problem="no" if self.unsound(values) else None)


def search(designer, generations=3, earns=lambda c: 0.1 + 0.1 * c.strategy, **settings):
    """The evaluations of each generation."""
    strategy = installed().create("evolution", "map_elites", settings, designer=designer, budget=BUDGET)
    found = []
    for _ in range(generations):
        candidates = sorted(strategy.ask(), key=lambda c: c.key)
        found.append(
            [
                Evaluation(c, "ok" if c.problem is None else "rejected", reward=min(earns(c), 1.0), distance_m=1.0)
                for c in candidates
            ]
        )
        strategy.tell(found[-1])
    return found


def varied(generations):
    return [e.candidate for generation in generations for e in generation if e.candidate.agent == BUDGET.n_agent]


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


def test_members_are_varied_and_the_ids_are_new():
    generations = search(Hooks(), varied=6)
    assert varied(generations[:1]) == []
    new = varied(generations)
    assert len(new) == 12
    ids = [e.candidate.id for generation in generations for e in generation]
    assert len(set(ids)) == len(ids)
    assert all(candidate.parents[0] in ids for candidate in new)
    assert len({candidate.content for candidate in new}) == 12
    assert all((np.abs(candidate.plan.poses) <= 0.7).all() for candidate in new)


def test_the_way_to_a_member_of_the_same_structure_is_one_way_to_vary():
    """Members lie on a line; all coordinates of an offspring differ by about the same, and not by one step each."""
    spread, along = [], []
    for seed in range(10):
        for candidate in varied(search(Hooks(seed), 2, varied=6)):
            parent = 0.1 * int(candidate.parents[0].split("-")[2][1:])
            moved = candidate.plan.poses - parent
            along.append(abs(moved.mean()))
            spread.append(moved.std())
    assert max(along) > 0.05
    assert np.median(spread) < 0.01


def test_what_breaks_a_rule_is_drawn_again():
    designer = Hooks(unsound=lambda values: values[0] > 0.25)
    new = varied(search(designer, varied=6))
    assert sum(candidate.problem is None for candidate in new) > 10


def test_only_what_earned_something_is_varied():
    assert varied(search(Hooks(), varied=6, earns=lambda c: 0.0)) == []


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"varied": -1}, r"evolution\.varied must be 0 or greater, got -1"),
        ({"measures": ["weight"]}, "no measure 'weight'"),
        ({"measures": 3}, "setting 'measures' can't be 3"),
    ],
)
def test_wrong_settings(settings, message):
    with pytest.raises(UserError, match=message):
        search(Hooks(), **settings)


# --- whole runs -------------------------------------------------------------------------------------------------

WORDS = ("evolution=map_elites", "evolution.varied=6", "budget.n_iteration=2")


def config(toy, fails_at=None):  # noqa: F811
    cfg = toys.config(toy.file, *WORDS)
    OmegaConf.update(cfg, "executor.fails_at", fails_at, force_add=True)
    return cfg


@pytest.mark.thorough
def test_an_interrupted_run_comes_to_the_same_archive(toy, tmp_path):  # noqa: F811
    whole = run(config(toy), tmp_path / "whole")
    tried = len(toy.lines("tried"))
    assert any(e.candidate.agent == 4 and e.status == "ok" for e in whole.generations[-1].evaluations)
    assert len(json.loads((tmp_path / "whole/archive/designs.json").read_text())["strategies"]) > 3
    for at in (3, 9, 14):
        folder = tmp_path / str(at)
        assert run(config(toy, fails_at=at), folder).stopped == "interrupted"
        resume(folder, ["executor.fails_at=null"])
        assert_same_run(folder, tmp_path / "whole")
    assert len(toy.lines("tried")) == 4 * tried


@pytest.mark.thorough
def test_a_run_in_an_engine_is_the_same_with_one_worker_and_with_two(tmp_path):
    words = ["task=BringCube", "sim=mujoco", "evolution=map_elites", "evolution.varied=4", "listener=[]", "film=false"]
    words += ["budget.n_agent=1", "budget.n_tool=2", "budget.n_action=1", "budget.n_iteration=1"]
    words += ["evolution.refine=12", "evolution.measures=[extent,touch]"]
    for workers in (1, 2):
        Experiment(*words, f"executor.workers={workers}").run(tmp_path / str(workers))
    assert_same_run(tmp_path / "1", tmp_path / "2")
    rows = list(csv.DictReader((tmp_path / "1/archive/archive.csv").open()))
    touches = np.array([float(row["touch_m"]) for row in rows])
    assert len(rows) > 1
    assert (touches < 1).any()
    cells = [int(row["cell_touch"]) for row in rows if row["cell_touch"]]
    assert cells == [24 if not touch < 1 else int(25 * touch) for touch in touches][: len(cells)]
    generations = json.loads((tmp_path / "1/result.json").read_text())["generations"]
    assert [g["n_candidates"] for g in generations][:2] == [2, 6]
