"""Cells as text: rounded honestly, and never a formula."""

import csv
import io

import pytest

from plugins.results.pages.formats import CellLink, Column, Table, printed, to_csv


def test_cells_in_a_file_of_commas(tmp_path):
    columns = (Column("text"), Column("number", 2), Column("link"))
    rows = (
        ("=1+1|\x1b[31m\n*b*", 1 / 3, CellLink("a|b", tmp_path / "x" / "y")),
        ("", None, ()),
    )
    table = Table("t", columns, rows)
    text = to_csv(table, tmp_path / "out")
    (first, second) = csv.DictReader(io.StringIO(text))
    assert first["text"] == "'=1+1|[31m *b*"  # no formula, no escape sequence
    assert float(first["number"]) == 1 / 3
    assert first["link"] == "../x/y"
    assert second == {"text": "", "number": "", "link": ""}
    assert printed(None, columns[1]) == "–"


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("＝1+1", "'＝1+1"),
        ("＠SUM(1)", "'＠SUM(1)"),
        (" =1", "'=1"),
        ("a;=1; -2;b", "a;'=1; '-2;b"),
        ("a - b = c; d", "a - b = c; d"),
    ],
)
def test_no_cell_begins_a_formula_in_any_language(text, written, tmp_path):
    table = Table("t", (Column(text),), ((text,),))
    assert list(csv.reader(io.StringIO(to_csv(table, tmp_path)))) == [[written]] * 2
