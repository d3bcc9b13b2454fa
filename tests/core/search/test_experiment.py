import json

import pytest

import core
from core import Experiment
from core.errors import UsageError, UserError
from core.plugins import installed
from core.support.text import hydra_word
from tests.support import toys

pytestmark = pytest.mark.slow

SIZES = [
    "budget=tiny",
    "budget.n_tool=2",
    "budget.n_action=2",
    "budget.n_iteration=1",
    "film=false",
]


@pytest.fixture
def parts(monkeypatch, tmp_path):
    for key, offer in toys.offered().items():
        monkeypatch.setitem(installed().offers, key, offer)
    notes = [f"vlm.notes={tmp_path / 'notes'}", f"executor.notes={tmp_path / 'notes'}"]
    return {"sim": "toy", "vlm": "toy", "executor": "here", "listener": []}, [
        *SIZES,
        *notes,
    ]


def test_it_does_what_the_command_does(parts, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, words = parts
    experiment = Experiment(*words, task="BringCube", seed=3, **names)
    result = experiment.run()
    assert result is experiment.result
    assert experiment.folder.parent.name == "BringCube"
    written = json.loads((experiment.folder / "result.json").read_text())
    assert written["best"]["reward"] == result.best.reward
    assert experiment.config.seed == 3
    again = Experiment(*words, task="BringCube", seed=3, **names).run(
        tmp_path / "again"
    )
    assert again.best.candidate.content == result.best.candidate.content


def test_a_folder_is_one_runs(parts, tmp_path):
    names, words = parts
    Experiment(*words, **names).run(tmp_path / "run")
    with pytest.raises(UserError, match="run"):
        Experiment(*words, **names).run(tmp_path / "run")


def test_mistakes_are_reported_at_once():
    with pytest.raises(
        UsageError, match=r"no task 'BringCub' \(did you mean 'BringCube'\?\)"
    ):
        Experiment(task="BringCub")
    with pytest.raises(UsageError, match="no key 'sede' in the configuration"):
        Experiment(sede=1)


@pytest.mark.parametrize(
    ("value", "word"),
    [
        (None, "null"),
        (True, "true"),
        (3, "3"),
        (0.5, "0.5"),
        ("a/b.json", "a/b.json"),
        ("it's 5, or", '"it\'s 5, or"'),
        ('5" or', r'"5\" or"'),
    ],
)
def test_values_as_the_command_line_has_them(value, word):
    assert hydra_word(value) == word


def test_lists_are_lists():
    assert hydra_word(["a", 1, [False]]) == "[a,1,[false]]"
    assert hydra_word([{"name": "a b", "x": 1}]) == '[{name:"a b",x:1}]'


def test_nothing_else_is_in_the_package_itself():
    with pytest.raises(AttributeError, match="no attribute 'Experimet'"):
        core.Experimet  # noqa: B018
