"""``vlmgineer report`` as a user runs it."""

import re

import pytest

from core.errors import UserError
from plugins.results.report.report_command import main
from tests.core.run_folders import write_run

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    "folder", ["0_seed=0", "runs=0_seed=0"]
)  # as it is, with a = as multiruns have, or by key
def test_the_command(tmp_path, monkeypatch, capsys, folder):
    write_run(tmp_path / "0_seed=0", rewards=[[0.25]])
    monkeypatch.chdir(tmp_path)
    main([folder, "output=out"])
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].split()[-5:] == ["1", "0.250", "0.250", "–", "1.50"]
    assert lines[-1] == "out/index.html"
    # One run has nothing to draw.
    assert {f.suffix for f in (tmp_path / "out" / "data").iterdir()} == {".csv"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "no folder given; usage: "),
        (["--output", "x"], "can't read '--output'; usage: "),
        (["nowhere"], "no folder nowhere"),
        (["."], "holds no run"),
        (
            ["killed", "output=out"],
            "no run is finished; 1 are listed in out/index.html",
        ),
        (["killed", "output=killed/run.sqlite"], "can't write"),
        (
            ["killed", "names=ours"],
            "no key 'names' in the configuration (did you mean 'name'?)",
        ),
    ],
)
def test_mistakes(tmp_path, monkeypatch, words, said):
    if "killed" in words:
        write_run(tmp_path / "killed", finish=False)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=re.escape(said)):
        main(words)
