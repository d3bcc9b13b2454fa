from pathlib import Path

import pytest

from plugins.results.named_folders import folders_and_overrides


@pytest.mark.parametrize(
    ("words", "folders"),
    [
        (["here", "runs=a/b", "top=3"], ["here", "a/b"]),
        (["run=a=b"], ["a=b"]),
    ],
)
def test_folders_are_given_as_they_are_or_as_runs(words, folders):
    assert folders_and_overrides("usage: ", words) == (
        [Path(folder) for folder in folders],
        [word for word in words if word == "top=3"],
    )


def test_a_folder_that_is_there_is_one_with_any_name(tmp_path, monkeypatch):
    (tmp_path / "seed=1").mkdir()
    (tmp_path / "[x]").mkdir()
    monkeypatch.chdir(tmp_path)
    assert folders_and_overrides("usage: ", ["seed=1", "runs=[x]"]) == (
        [Path("seed=1"), Path("[x]")],
        [],
    )
