import json
from pathlib import Path

import pytest

from core.errors import UserError
from core.facts import LABELS, MARK, read_figures, sheet, write_page
from core.robot.description import MEASURED, measured_figures
from tests.test_commands import call

ROOT = Path(__file__).parents[2]


def test_the_page_has_the_sheet_of_the_stored_figures():
    """``python -m core.facts output=core/robot/measured.json page=docs/arm.md`` writes both."""
    assert (ROOT / "docs/arm.md").read_text().split(MARK)[1].strip() == sheet(measured_figures()).strip()


def test_every_figure_has_a_row():
    figures = measured_figures()
    assert set(figures) == {"mujoco", "pybullet", "sapien"}
    assert all(set(one) == set(LABELS) for one in figures.values())
    rows = sheet(figures).split("## Exactness")[1].splitlines()
    assert len([row for row in rows if row.startswith("|")]) == 2 + len(LABELS)
    assert "full force at once" in sheet(figures)


def test_a_page_keeps_what_surrounds_the_sheet(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"before\n{MARK}old\n{MARK}after\n")
    write_page(page, "new\n")
    assert page.read_text() == f"before\n{MARK}\nnew\n{MARK}after\n"
    page.write_text("no marks\n")
    with pytest.raises(UserError, match="needs two lines <!-- sheet -->"):
        write_page(page, "new\n")
    with pytest.raises(UserError, match=r"missing\.md can't be read"):
        write_page(tmp_path / "missing.md", "new\n")


def test_figures_of_other_engines_are_kept(tmp_path):
    assert read_figures(tmp_path / "none.json") == {}
    assert read_figures(MEASURED) == measured_figures()
    for text, complaint in (("{", "can't be read"), ("[1]", "no file of figures")):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(UserError, match=complaint):
            read_figures(tmp_path / "bad.json")


@pytest.mark.slow
def test_the_command_adds_an_engine(tmp_path):
    (tmp_path / "figures.json").write_text(json.dumps({"mine": measured_figures()["sapien"]}))
    done = call(tmp_path, "facts", "sims=[mujoco]", "output=figures.json")
    assert done.returncode == 0, done.stderr
    assert "| figure | mine | mujoco |" in done.stdout
    assert list(json.loads((tmp_path / "figures.json").read_text())) == ["mine", "mujoco"]
