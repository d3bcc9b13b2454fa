import numpy as np

from core.config.compose import load
from tests.benchmarks.neighbours import HARD, correlations, markdown, neighbours


def test_designs_differ_from_the_solution_ever_more():
    made = neighbours(load("evaluate", ["protocol=varied", "task=OpenLatch"]), 4, 1.0)
    again = neighbours(load("evaluate", ["protocol=varied", "task=OpenLatch"]), 4, 1.0)
    assert [design.content for design in made] == [design.content for design in again]
    assert len({design.content for design in made}) == 4
    nearly = neighbours(load("evaluate", ["protocol=varied", "task=OpenLatch"]), 1, 1e-9)[0]

    def change(design):
        return np.mean(
            [np.abs(np.subtract(a.offset, b.offset)) for a, b in zip(design.plan.steps, nearly.plan.steps, strict=True)]
        )

    assert change(made[0]) < change(made[3])
    assert change(made[0]) > 0


def test_the_table_has_every_pair_of_engines():
    rewards = {"one": [0.0, 0.5, 1.0], "two": [0.1, 0.2, 0.3], "three": [0.0, 0.0, 0.0]}
    assert correlations(rewards, list(rewards)) == [1.0, None, None]
    lines = markdown({"A": rewards, "B": rewards}, list(rewards)).splitlines()
    assert lines[0] == "| task | one, two | one, three | two, three | mean, one | mean, two | mean, three |"
    assert lines[2] == "| A | 1.00 | – | – | 0.500 | 0.200 | 0.000 |"
    assert lines[4] == "| **mean** | 1.00 | – | – | 0.500 | 0.200 | 0.000 |"


def test_it_is_about_the_harder_tasks():
    assert len(HARD) == 12
