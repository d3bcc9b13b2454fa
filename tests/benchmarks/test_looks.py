"""The hand-written plans of the benchmark of looks."""

import pytest

from plugins.actions.blocks import LookStep, list_items
from tests.benchmarks.looks import LOOKING, find_task, list_candidates

NAMES = sorted(file.stem for file in LOOKING.glob("*.json"))


@pytest.mark.parametrize("name", NAMES)
def test_one_plan_looks_and_the_other_does_not(name):
    task = find_task(name).create()
    looks = {}

    for label, candidate in list_candidates(name, task):
        items = list_items(candidate.plan.steps)
        looks[label] = any(isinstance(item, LookStep) for item in items)

    assert looks == {"once": False, "looks": True}


@pytest.mark.parametrize("file", sorted(LOOKING.glob("*.yaml")), ids=lambda f: f.stem)
def test_each_scene_has_plans(file):
    assert file.with_suffix(".json").is_file()
