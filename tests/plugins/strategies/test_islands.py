"""Islands: agents are dealt to populations, the best travel, and an island that idles starts again."""

import json

import numpy as np
import pytest

from core.design import Candidate, Tool
from core.errors import UserError
from core.interfaces import Budget
from core.plugins import installed
from core.search.orchestration import run
from plugins.conformance.evaluations import tried_once
from tests.support import toys
from tests.support.runs import rows

BUDGET = Budget(4, 1, 1, 9, 2, 0.0, k_least=0)


class Teams:
    """A designer that remembers the teams that it was asked for."""

    def __init__(self):
        self.asked = []

    def design_in(self, generation, teams):
        self.asked.append(teams)
        for team in teams:
            for agent in team.agents:
                yield Candidate(Tool(), np.zeros((1, 6)), generation, agent)


def search(*rewards, **settings):
    """The ids of each island's elites, by generation; ``rewards`` are those of four agents."""
    designer = Teams()
    strategy = installed().create(
        "evolution", "islands", settings, designer=designer, budget=BUDGET
    )
    for generation in rewards:
        candidates = sorted(strategy.ask(), key=lambda c: c.key)
        pairs = zip(candidates, generation, strict=True)
        strategy.tell(
            [tried_once(c, "ok", reward=reward, distance_m=1.0) for c, reward in pairs]
        )
    list(strategy.ask())
    shown = [
        [[e.candidate.id[:5] for e in team.elites] for team in teams]
        for teams in designer.asked
    ]
    return shown, designer.asked


def test_agents_are_dealt_and_islands_keep_their_own_elites():
    shown, asked = search([0.1, 0.9, 0.2, 0.8], [0.3, 0.0, 0.0, 0.0], migrate=9)
    assert [list(team.agents) for team in asked[0]] == [[0, 2], [1, 3]]
    assert shown == [
        [[], []],
        [["g0-a2", "g0-a0"], ["g0-a1", "g0-a3"]],
        [["g1-a0", "g0-a2"], ["g0-a1", "g0-a3"]],
    ]


def test_each_island_has_its_temperature_and_style():
    _, asked = search(islands=3, warmth=0.4, styles=["", "short"])
    assert [team.warmth for team in asked[0]] == pytest.approx([-0.4, 0.0, 0.4])
    assert [team.style for team in asked[0]] == ["", "short", ""]
    assert [team.warmth for team in search(islands=1)[1][0]] == [0.0]


def test_the_best_of_each_island_goes_to_the_next():
    shown, _ = search([0.1, 0.9, 0.3, 0.4], [0.0, 0.0, 0.0, 0.0], islands=4, migrate=2)
    assert shown[1] == [["g0-a0"], ["g0-a1"], ["g0-a2"], ["g0-a3"]]
    assert shown[2] == [
        ["g0-a3", "g0-a0"],
        ["g0-a1", "g0-a0"],
        ["g0-a1", "g0-a2"],
        ["g0-a3", "g0-a2"],
    ]


def test_an_island_that_does_not_improve_starts_from_nothing():
    idle, good = 0.5, 0.1
    generations = [[idle + 0.001 * g, good + 0.1 * g, 0.0, 0.0] for g in range(5)]
    shown, _ = search(*generations, migrate=9, patience=3)
    assert [bool(first) for first, _ in shown] == [False, True, True, True, False, True]
    assert all(second for _, second in shown[1:])
    assert shown[5][0] == ["g4-a0"]
    migrating, _ = search(*generations, migrate=4, patience=3)
    assert migrating[4][0] == []  # nothing comes to where nothing is
    assert "g3-a0" in migrating[4][1]  # what it had found has left


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"islands": 5}, r"evolution\.islands is 5, but budget\.n_agent is 4"),
        ({"islands": 0}, "setting 'islands' can't be 0: must be greater than 0"),
        ({"migrate": 0}, "setting 'migrate' can't be 0: must be greater than 0"),
        ({"patience": -1}, "setting 'patience' can't be -1: must be greater than 0"),
        ({"styles": []}, "setting 'styles'"),
    ],
)
def test_wrong_settings(settings, message):
    with pytest.raises(UserError, match=message):
        search(**settings)


def test_requests_of_a_run_differ_from_island_to_island(toy, tmp_path):
    words = ("evolution=islands", "budget.n_iteration=2")
    run(toys.config(toy.file, *words), tmp_path / "whole")
    texts = {a: (tmp_path / f"whole/requests/g1-a{a}.md").read_text() for a in range(4)}
    assert ["few and simple components" in texts[a] for a in range(4)] == [
        False,
        True,
        False,
        True,
    ]
    stored = rows(
        tmp_path / "whole/run.sqlite",
        "SELECT agent, elites, temperature FROM requests WHERE generation = 1",
    )
    elites = {agent: json.loads(ids) for agent, ids, _ in stored}
    assert elites[0] == elites[2]
    assert all(name.startswith(("g0-a0", "g0-a2")) for name in elites[0])
    assert all(name.startswith(("g0-a1", "g0-a3")) for name in elites[1])
    assert elites[0]
    assert elites[1]
    assert "g0-a3-" not in texts[0]
    assert "g0-a3-" in texts[1]
