"""Paths on the command line, as people and browsers name folders."""

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from core.config.compose import load
from core.config.words import quote_paths
from core.errors import UsageError

FOLDERS = [
    "arm (1)",
    "lr=3e-4,b",
    "[v2] scene",
    "{a: b}",
    "it's",
    'a "big" one',
    "模型 Größe",
    "a#b%c~d$e!",
    "back\\slash\\",
    "a;b&c|d*e?",
    "~nobody of this name",
]


def value(word):
    (override,) = OverridesParser.create().parse_overrides(quote_paths([word]))
    return override.value()


@pytest.mark.parametrize("name", FOLDERS)
def test_an_existing_path_is_taken_as_it_is(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir()
    (tmp_path / name / "scene.yaml").touch()
    assert value(f"task.file={name}") == name
    assert value(f"task.file={name}/scene.yaml") == f"{name}/scene.yaml"
    assert value(f"task.file={tmp_path}/{name}") == f"{tmp_path}/{name}"
    assert value(f"output={name}/new, (1).json") == f"{name}/new, (1).json"
    assert load("evaluate", [f"designs={name}"]).designs == name


def test_a_path_refers_to_no_other_key(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "${seed}").mkdir()
    assert load("evaluate", ["designs=${seed}"]).designs == "${seed}"


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("seed=1", 1),
        ("robot.base=[0,0.3,0,0]", [0, 0.3, 0, 0]),
        ("a={b: c}", {"b": "c"}),
        ("a='quoted, text'", "quoted, text"),
    ],
)
def test_what_is_no_path_is_read_as_before(tmp_path, monkeypatch, word, meant):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "1").touch()
    assert value(word) == meant


@pytest.mark.parametrize(
    "words",
    [["output=in/${now:%F}"], ["-m", "designs=in/a.json,in/b.json"]],
)
def test_a_reference_or_a_sweep_in_a_folder_stays_one(tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in").mkdir()
    assert quote_paths(words) == words


@pytest.mark.parametrize("plain", ["1", "null", "true", "2.5"])
def test_a_number_is_none_of_the_paths(tmp_path, monkeypatch, plain):
    monkeypatch.chdir(tmp_path)
    (tmp_path / plain).touch()
    assert quote_paths([f"seed={plain}", f"+seed={plain}", "-m"]) == [
        f"seed={plain}",
        f"+seed={plain}",
        "-m",
    ]


@pytest.mark.parametrize(
    ("word", "line"),
    [
        (
            "designs=arm (2).json",
            "can't read designs=arm (2).json; put its value in quotes: 'designs=\"arm (2).json\"'",
        ),
        (
            "designs=a=b.json",
            "can't read designs=a=b.json; put its value in quotes: 'designs=\"a=b.json\"'",
        ),
        (
            "designs=it's",
            """can't read designs=it's; put its value in quotes: 'designs="it'"'"'s"'""",
        ),
        (
            "designs=模",
            "can't read designs=模; put its value in quotes: 'designs=\"模\"'",
        ),
        (
            "designs=[v3] scene",
            "can't read designs=[v3] scene; close its brackets, put texts in them in quotes, or if it is a text "
            "put its value in quotes: 'designs=\"[v3] scene\"'",
        ),
        (
            "robot.base=[0, 0.3",
            "can't read robot.base=[0, 0.3; close its brackets, put texts in them in quotes, or if it is a text "
            "put its value in quotes: 'robot.base=\"[0, 0.3\"'",
        ),
        ("designs", "can't read 'designs'; write KEY=VALUE"),
    ],
)
def test_every_error_of_the_grammar_names_the_word_and_what_to_type(
    tmp_path, monkeypatch, word, line
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError) as error:
        load("evaluate", ["task=BringCube", word])
    assert str(error.value) == line
