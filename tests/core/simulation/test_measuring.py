"""What is measured of every rollout, and that a plugin's figure is in trials, store, report, prompts and the order."""

import json

import numpy as np
import pytest

from core.config.compose import load
from core.design import Candidate
from core.errors import UsageError
from core.plugins import Offer, installed
from core.search.orchestration import run
from core.simulation.measuring import figures
from core.store.reader import StoredRun
from core.trial import Figure
from plugins.results.pages.runs import find_runs
from plugins.results.report.results import Results
from plugins.results.report.tables import runs
from tests.support.faults import Faulty, Slide, candidate
from tests.support.playing import evaluate_batch

WORDS = [
    "task=BringCube",
    "sim=mujoco",
    "budget=tiny",
    "budget.n_action=3",
    "budget.n_iteration=1",
    "budget.reward_save=-1",
    "evolution.tie=1",
    "fitness.changes=0",
    "film=false",
    "listener=[]",
    "prompt.picture=false",
]


def measure_reach(task, motion, outcome):
    """How far from the base the last waypoint is, metres."""
    return abs(motion.plan[-1, 0])


@pytest.fixture
def reach(monkeypatch):
    """A figure of a plugin, of which more is better."""
    words = "how far the plan ends"
    figure = Figure(measure_reach, "reach (m)", 3, words, less_is_better=False)
    offer = Offer("figure", "reach_m", "tests", "tests", figure)
    monkeypatch.setitem(installed().offers, ("figure", "reach_m"), offer)
    figures.cache_clear()
    yield "reach_m"
    figures.cache_clear()


def test_what_was_played_is_measured_and_what_was_not_has_no_figures():
    refused = Candidate(None, np.zeros((0, 6)), 0, 0, 9, 0, problem="no tool")
    played, rejected = evaluate_batch(Slide(), Faulty(), [candidate(0), refused])
    assert set(played.trials[0].measured) == set(figures())
    assert played.trials[0].measured["motion_s"] > 0
    assert rejected.trials[0].measured == {}


@pytest.mark.slow
@pytest.mark.usefixtures("inline")
def test_a_figure_of_a_plugin_is_stored_told_reported_and_decides(reach, tmp_path):
    folder = tmp_path / "run"
    run(load("config", [*WORDS, f"fitness.tie_by={reach}"]), folder)

    tried = [e for e in StoredRun(folder).evaluations() if e.status == "ok"]
    values = {e.candidate: e.trials[0].measured[reach] for e in tried}
    assert len(set(values.values())) > 1
    highest = max(values.values())

    best = json.loads((folder / "result.json").read_text())["best"]
    assert best["measured"].keys() == figures().keys()
    assert best["measured"][reach] == highest == values[best["candidate"]]

    table = runs(Results(tuple(find_runs([tmp_path])[0])))
    names = [column.name for column in table.columns]
    (row,) = table.rows
    assert row[names.index("reach (m)")] == highest
    assert row[names.index("distance (m)")] == best["measured"]["distance_m"]

    prompt = (folder / "requests" / "g1-a0.md").read_text()
    assert "- `reach_m`: how far the plan ends." in prompt
    shown = max(value for name, value in values.items() if name.startswith("g0-"))
    assert f'"reach_m": {round(shown, 4)}' in prompt
    assert "with the highest `reach_m`, how far the plan ends" in prompt


def test_a_figure_that_there_is_not_decides_nothing(tmp_path):
    with pytest.raises(UsageError, match=r"no figure .grace. in fitness\.tie_by"):
        run(load("config", [*WORDS, "fitness.tie_by=grace"]), tmp_path)
