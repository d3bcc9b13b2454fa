"""What is said of a name of this program that a plugin of yesterday looks for."""

import pkgutil
from importlib import import_module

import pytest

from core.plugins import Plugins
from core.plugins.moved import FLAT, MOVED, explain


def fail(code):
    with pytest.raises((ImportError, AttributeError)) as caught:
        exec(code, {})
    return explain(caught.value)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("from core.scene import Goal", "core.scene.Goal is core.goals.Goal now"),
        (
            "import core.scene\ncore.scene.Goal",
            "core.scene.Goal is core.goals.Goal now",
        ),
        (
            "from core.interfaces import Guards",
            "core.interfaces.Guards is core.interfaces.Reactions now",
        ),
        (
            "from core.design import Trial",
            "core.design.Trial is core.trial.Trial now",
        ),
        (
            "from core.support.progress import busy",
            "core.support.progress is core.support.progress_display now",
        ),
        (
            "from core.scene import NoSuchThing",
            "core.scene.NoSuchThing is no more: CHANGELOG.md says what is instead",
        ),
    ],
)
def test_it_is_named_with_what_replaces_it(code, said):
    assert said in fail(code)


@pytest.mark.parametrize(
    "code", ["import no_such_module", "from json import no_such_name", "(1).x"]
)
def test_of_other_modules_nothing_is_said(code):
    assert " now" not in fail(code)
    assert "CHANGELOG" not in fail(code)


@pytest.mark.parametrize(("before", "now"), MOVED.items())
def test_the_table_names_what_is_there_and_not_what_is_there_still(before, now):
    pkgutil.resolve_name(now)
    with pytest.raises((ImportError, AttributeError)):
        pkgutil.resolve_name(before)


def test_all_that_plugins_import_is_looked_through():
    for flat in FLAT:
        import_module(flat)


def test_the_plugin_is_named(tmp_path, monkeypatch):
    """As a command says it: the plugin, the name, and what replaces it."""
    import importlib.metadata

    (tmp_path / "old_plugin.py").write_text("from core.scene import Goal\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    entry = importlib.metadata.EntryPoint("old", "old_plugin", "vlmgineer")
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [entry])
    (failure,) = Plugins().failures
    assert failure.entry_point == "old"
    assert failure.reason.endswith("core.scene.Goal is core.goals.Goal now")
