"""References with guards hold where places are seen wrong by a centimetre and heights are off; see `protocol=felt`."""

from pathlib import Path

import pytest

from core.config.compose import load, node
from core.designs.reading import load_designs, read_designs
from core.interfaces import RolloutSettings
from core.plugins import installed
from plugins.fitness.layouts import UNSEEN
from tests.support.engines import simulator
from tests.support.playing import evaluate_batch
from tests.support.rare import rare
from tests.support.solutions import anchored, representation

pytestmark = pytest.mark.slow

FILES = sorted((Path(__file__).parent / "felt").glob("*.json"))
PROTOCOL = load("config", ["protocol=felt"])


def rewards(candidate, task, engine, layouts):
    settings = node(PROTOCOL.rollout, RolloutSettings)
    return [
        evaluate_batch(task, simulator(engine), [candidate], UNSEEN + k, settings)[
            0
        ].reward
        for k in layouts
    ]


def guarded(file, task):
    return read_designs(load_designs(file), representation(file, "pla"), task)[0]


@pytest.mark.parametrize("file", rare(FILES, FILES[0]), ids=lambda file: file.stem)
def test_guards_find_what_was_seen_wrong(file):
    task = installed().create("task", file.stem, variation="wide")
    found = rewards(guarded(file, task), task, "mujoco", range(3))
    assert sum(found) / 3 >= 0.66


@pytest.mark.thorough
@pytest.mark.parametrize(
    "engine", rare(PROTOCOL.protocol.engines, "mujoco", mark="weekly")
)
@pytest.mark.parametrize(
    "file", rare(FILES, *FILES[:4], mark="weekly"), ids=lambda file: file.stem
)
def test_guards_are_worth_it_in_unseen_layouts(file, engine):
    task = installed().create("task", file.stem, variation="wide")
    layouts = range(6)
    # Of paper: of PLA four of them would bend or break.
    blind = rewards(anchored(file.stem), task, engine, layouts)
    felt = rewards(guarded(file, task), task, engine, layouts)
    nothing_to_gain = min(blind) >= 0.99

    assert sum(felt) / len(felt) >= 0.75
    assert sum(felt) > sum(blind) or nothing_to_gain
