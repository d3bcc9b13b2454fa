import importlib.metadata
import json
import tomllib
from pathlib import Path

import pytest

from core.errors import UsageError, UserError
from core.hooks import PROJECT, hookimpl
from core.interfaces import Task
from core.plugins import Plugins, installed
from tests.core.plugins.offering import Engine, Offering

ROOT = Path(__file__).parents[3]


def test_the_projects_own_parts_come_by_entry_points():
    assert not installed().failures
    entries = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"][
        "entry-points"
    ][PROJECT]
    offers = installed().offers
    own = {
        offer.entry_point
        for offer in offers.values()
        if offer.distribution == "vlmgineer"
    }
    assert own == set(entries)
    expected = {
        ("task", "BringCube"),
        ("task", "OneBook"),
        ("sim", "pybullet"),
        ("vlm", "offline"),
        ("tool", "urdf"),
        ("evolution", "vlmgineer"),
        ("evolution", "sampling"),
        ("executor", "local"),
        ("listener", "progress"),
    }
    assert expected <= set(offers)


def test_an_import_that_fails_is_remembered_and_hurts_nobody(monkeypatch):
    def entry(name, value):
        return importlib.metadata.EntryPoint(name, value, PROJECT)

    entries = [
        entry("broken", "no_such_module_anywhere"),
        entry("worse", "tasks:no_such_attribute"),
        entry("good", "tasks"),
    ]
    asked = []
    monkeypatch.setattr(
        importlib.metadata, "entry_points", lambda **how: asked.append(how) or entries
    )
    found = Plugins()
    assert asked == [{"group": PROJECT}]
    assert "BringCube" in found.names("task")
    assert [failure.entry_point for failure in found.failures] == ["broken", "worse"]
    assert (
        "ModuleNotFoundError: No module named 'no_such_module_anywhere'"
        in found.failures[0].reason
    )
    assert "no_such_attribute" in found.failures[1].reason
    with pytest.raises(
        UserError,
        match=r"no sim 'pybullet'; possible: none; plugin 'broken' failed: import failed",
    ):
        found.factory("sim", "pybullet")


def test_no_other_package_replaces_a_built_in_part(monkeypatch):
    own = list(importlib.metadata.entry_points(group=PROJECT))
    # As if listed first, it offers BringCube too.
    other = importlib.metadata.EntryPoint("other", "tasks", PROJECT)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **how: [other, *own])
    found = Plugins()
    assert found.offers["task", "BringCube"].distribution == PROJECT
    assert {failure.entry_point for failure in found.failures} == {"other"}
    assert any("is taken by" in failure.reason for failure in found.failures)


def test_an_import_that_ends_the_process(monkeypatch, tmp_path):
    (tmp_path / "moody.py").write_text("raise SystemExit('not today')")
    monkeypatch.syspath_prepend(tmp_path)
    entry = importlib.metadata.EntryPoint("moody", "moody", PROJECT)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [entry])
    (failure,) = Plugins().failures
    assert failure.reason == "import failed: SystemExit: not today"


def test_a_name_that_is_taken_stays_with_the_first(found):
    found.register(Offering(simulators={"grid": Engine}), "first", "one")
    found.register(
        Offering(simulators={"grid": Task, "other": Engine}), "second", "two"
    )
    assert found.factory("sim", "grid") is Engine
    assert found.names("sim") == ["grid", "other"]
    (failure,) = found.failures
    assert (failure.entry_point, failure.distribution) == ("second", "two")
    assert failure.reason == "sim 'grid' is taken by first of one"


@pytest.mark.parametrize(
    ("offered", "reason"),
    [
        (RuntimeError("oh no"), "RuntimeError: oh no"),
        (SystemExit(0), "SystemExit: 0"),
        (["grid"], "ValueError"),
        (5, "TypeError"),
        ("grid", "ValueError"),
    ],
)
def test_a_hook_that_fails_takes_only_itself_along(found, offered, reason):
    path = offered if isinstance(offered, BaseException) else None
    found.register(
        Offering(simulators=offered, executors={"grid": Engine}, config_path=path),
        "mine",
        "my-package",
    )
    failure, *others = found.failures
    assert failure.reason.startswith("hook 'simulators' failed: ")
    assert reason in failure.reason
    assert [other.reason for other in others] == (
        [f"hook 'config_path' failed: {reason}"] if path is not None else []
    )
    assert found.names("sim") == []
    assert found.names("executor") == ["grid"]


def test_a_plugin_without_hooks_is_a_failure_that_names_its_file(monkeypatch, tmp_path):
    (tmp_path / "unhooked.py").write_text("def simulators(): return {}")
    monkeypatch.syspath_prepend(tmp_path)
    entry = importlib.metadata.EntryPoint("mine", "unhooked", PROJECT)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [entry])
    (failure,) = Plugins().failures
    assert (
        f"{tmp_path / 'unhooked.py'}'> implements no hook; possible: tasks, robots, "
        in failure.reason
    )


def test_a_hook_that_there_is_not_is_a_failure(found):
    found.register(
        Offering(simulators={"grid": Engine}, simulator={"grid": Engine}),
        "mine",
        "my-package",
    )
    (failure,) = found.failures
    assert failure.reason.startswith("unknown hook 'simulator' in plugin ")


def test_a_hook_with_the_wrong_signature_is_a_failure(found):
    class Wrong:
        @hookimpl
        def simulators(self, extra):
            return {"grid": Engine}

    found.register(Wrong(), "mine", "my-package")
    (failure,) = found.failures
    assert "extra" in failure.reason
    assert not found.offers


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("conf", "it gave 'conf'; expected a package that holds YAML files"),
        (
            "pkg://no_such_package_anywhere",
            "it gave 'pkg://no_such_package_anywhere'; expected",
        ),
        (
            "pkg://no_such_package_anywhere.conf",
            "No module named 'no_such_package_anywhere'",
        ),
    ],
)
def test_configs_that_are_not_there_are_told(found, path, reason):
    class Brings:
        @hookimpl
        def config_path(self):
            return path

        @hookimpl
        def simulators(self):
            return {"grid": Engine}

    found.register(Brings(), "mine", "my-package")
    (failure,) = found.failures
    assert failure.reason.startswith("hook 'config_path' failed: ")
    assert reason in failure.reason
    assert not found.configs
    assert found.names("sim") == ["grid"]


def test_what_is_offered_beside_parts_is_found_by_its_hook(found):
    found.register(
        Offering(levels={"mute": Engine}, prompt_values={"notes": "json:dumps"}),
        "first",
        "one",
    )
    found.register(Offering(levels={"mute": Task, "deaf": Engine}), "second", "two")
    assert found.factory("level", "mute", "prompt.context") is Engine
    assert found.factories("prompt_value") == {"notes": json.dumps}
    with pytest.raises(
        UsageError,
        match=r"no level 'loud' in prompt\.context; possible: deaf, mute; plugin 'second' f",
    ):
        found.factory("level", "loud", "prompt.context")
