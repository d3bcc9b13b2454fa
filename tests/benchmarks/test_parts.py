import sys

import pytest

from tests.benchmarks import parts

pytestmark = [pytest.mark.slow, pytest.mark.thorough]


def test_both_tools_bring_the_cube(tmp_path, monkeypatch, capsys):
    (tmp_path / "page.md").write_text("<!-- parts -->\n<!-- end of parts -->\n")
    monkeypatch.setattr(sys, "argv", ["", "sims=mujoco", "parts=8", "repeats=1", f"page={tmp_path / 'page.md'}"])
    parts.main()
    row = capsys.readouterr().out.splitlines()[-1].split("|")
    assert row[1].strip() == "mujoco"
    assert all(float(reward) > 0.5 for reward in row[5].split(","))
    assert row[1:] == (tmp_path / "page.md").read_text().splitlines()[-2].split("|")[1:]
