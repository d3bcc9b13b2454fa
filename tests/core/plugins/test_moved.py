import importlib
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

from core.plugins import Plugins
from core.plugins.moved import places

MOVED = places()
CHANGELOG = (Path(__file__).parents[3] / "CHANGELOG.md").read_text()


def test_the_changelog_has_the_same_table():
    rows = re.findall(r"^\| (.*) \| (.*) \|$", CHANGELOG.partition("## What moved")[2], re.MULTILINE)[1:]
    assert {old.strip("`"): new.replace("`", "") for old, new in rows} == MOVED


@pytest.mark.parametrize("old", MOVED)
def test_what_moved_is_no_longer_there_and_its_new_place_is(old):
    with pytest.raises((AttributeError, ImportError)):
        pkgutil.resolve_name(old)
    place = re.split("[,;]", MOVED[old])[0]
    assert place == "the command vlmgineer view" or pkgutil.resolve_name(place)


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("import core.report.page", "core.report moved to plugins.results.report, the command vlmgineer report"),
        ("from core.materials import PAPER", "core.materials moved to core.values.materials"),
        ("from core.plugins import Part", "core.plugins.Part moved to core.plugins.PluginPart"),
        ("import core.design; core.design.Part", "core.design.Part moved to core.design.ConvexPart"),
    ],
)
def test_a_package_of_before_is_told_the_new_place(tmp_path, monkeypatch, line, place):
    """As discovery reports it, in one line, and the other plugins are there."""
    site = tmp_path / "theirs-1.dist-info"
    site.mkdir()
    (site / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 1\n")
    (site / "entry_points.txt").write_text("[vlmgineer]\ntheirs = their_part\n")
    (tmp_path / "their_part.py").write_text(f"{line}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "their_part", raising=False)
    plugins = Plugins()
    (failure,) = plugins.failures
    assert failure.distribution == "theirs"
    assert f"{place}; see What moved in CHANGELOG.md" in failure.reason
    assert "OneBook" in plugins.names("task")


def test_an_old_command_is_one_line():
    done = subprocess.run([sys.executable, "-m", "core.report", "runs"], capture_output=True, text=True)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "core.report moved to plugins.results.report, the command vlmgineer report; see What moved" in line


def test_another_module_that_is_not_there_is_reported_as_ever():
    with pytest.raises(ModuleNotFoundError, match=r"^No module named 'core.nothing'$"):
        importlib.import_module("core.nothing")
