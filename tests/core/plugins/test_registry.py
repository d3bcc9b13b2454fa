import importlib.metadata
import inspect
import os
import subprocess
import sys
import tomllib
from dataclasses import asdict, is_dataclass
from pathlib import Path

import pytest
import yaml
from omegaconf import OmegaConf

from core import plugins
from core.config import sources
from core.config.compose import load
from core.errors import UsageError, UserError
from core.hooks import PROJECT, hookimpl
from core.interfaces import VLM, Simulator, Task
from core.plugins import INTERFACES, KINDS, PROVIDED, Plugins, describe_part, installed
from core.plugins import __main__ as command

ROOT = Path(__file__).parents[3]
BUILT_IN = sorted(installed().offers)


class Engine(Simulator):
    """A part with settings."""

    def __init__(self, grid: int, time_step: float = 0.01, walls: list[str] | None = None) -> None:
        self.grid, self.time_step, self.walls = grid, time_step, walls

    def rollout(self, task, jobs):
        raise NotImplementedError

    def render(self, task, **_):
        raise NotImplementedError


class Offering:
    """A plugin, as a stranger might write it."""

    def __init__(self, **parts):
        for hook in KINDS.values():
            if hook in parts:
                setattr(self, hook, hookimpl(self._hook(parts[hook])))

    @staticmethod
    def _hook(offered):
        def hook():
            if isinstance(offered, Exception):
                raise offered
            return offered

        return hook


@pytest.fixture
def found(monkeypatch):
    """No plugins at all, until the test registers some."""
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [])
    return Plugins()


# --- discovery --------------------------------------------------------------------------------------------------


def test_the_projects_own_parts_come_by_entry_points():
    assert not installed().failures
    entries = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"][PROJECT]
    offers = installed().offers
    own = {offer.entry_point for offer in offers.values() if offer.distribution == "vlmgineer"}
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


def test_plugins_are_found_once_per_process():
    assert installed() is installed()


@pytest.mark.parametrize(("kind", "name"), [key for key in BUILT_IN if key[0] in INTERFACES])
def test_each_part_is_what_its_kind_says(kind, name):
    assert issubclass(installed().factory(kind, name), INTERFACES[kind])


@pytest.mark.parametrize(("kind", "name"), BUILT_IN)
def test_the_configs_are_the_factories_own_defaults(kind, name):
    parameters = inspect.signature(installed().factory(kind, name)).parameters
    defaults = {key: p.default for key, p in parameters.items() if key not in PROVIDED.get(kind, ())}
    document = yaml.safe_load((ROOT / "conf" / kind / f"{name}.yaml").read_text())
    if kind == "listener":  # several at once: the name is the key
        assert document == {name: defaults}
        return
    assert document.pop("name") == name
    if kind == "task":
        assert document.keys() >= {"tool_kinds", "paper"}
        document = {key: value for key, value in document.items() if key not in ("tool_kinds", "paper")}
    assert document == {key: asdict(value) if is_dataclass(value) else value for key, value in defaults.items()}


def test_every_config_names_a_part_that_there_is():
    for kind in KINDS:
        for file in (ROOT / "conf" / kind).glob("*.yaml"):
            names = yaml.safe_load(file.read_text())
            for name in names if kind == "listener" else [names["name"]]:
                assert (kind, name) in installed().offers, file


def test_an_import_that_fails_is_remembered_and_hurts_nobody(monkeypatch):
    def entry(name, value):
        return importlib.metadata.EntryPoint(name, value, PROJECT)

    entries = [
        entry("broken", "no_such_module_anywhere"),
        entry("worse", "tasks:no_such_attribute"),
        entry("good", "tasks"),
    ]
    asked = []
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **how: asked.append(how) or entries)
    found = Plugins()
    assert asked == [{"group": PROJECT}]
    assert "BringCube" in found.names("task")
    assert [failure.entry_point for failure in found.failures] == ["broken", "worse"]
    assert "ModuleNotFoundError: No module named 'no_such_module_anywhere'" in found.failures[0].reason
    assert "no_such_attribute" in found.failures[1].reason
    with pytest.raises(
        UserError, match=r"no sim 'pybullet'; possible: none; plugin 'broken' failed to load: import failed"
    ):
        found.factory("sim", "pybullet")


def test_an_import_that_raises_whatever_it_likes(monkeypatch, tmp_path):
    (tmp_path / "moody.py").write_text("raise RuntimeError('not today')")
    monkeypatch.syspath_prepend(tmp_path)
    entry = importlib.metadata.EntryPoint("moody", "moody", PROJECT)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [entry])
    (failure,) = Plugins().failures
    assert failure.reason == "import failed: RuntimeError: not today"


# --- a stranger's plugin ----------------------------------------------------------------------------------------


def test_a_registered_part_can_be_made(found):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    assert found.names("sim") == ["grid"]
    assert not found.failures
    engine = found.create("sim", "grid", {"grid": 3, "time_step": 1, "walls": ["a"]})
    assert (engine.grid, engine.time_step, engine.walls) == (3, 1.0, ["a"])
    assert isinstance(engine.time_step, float)
    assert found.create("sim", "grid", grid=7).grid == 7  # given by the program


def test_a_factory_may_be_named(found):
    found.register(Offering(simulators={"grid": f"{__name__}:Engine"}), "mine", "my-package")
    assert found.create("sim", "grid", {"grid": 3}).grid == 3


def test_a_factory_may_be_a_function(found):
    def make(size: int = 2) -> Engine:
        return Engine(size)

    found.register(Offering(simulators={"grid": make}), "mine", "my-package")
    assert found.create("sim", "grid", {"size": 5}).grid == 5
    with pytest.raises(UsageError, match=r"no setting 'grid' in sim=grid; possible: size"):
        found.create("sim", "grid", {"grid": 5})


def test_a_name_that_is_taken_stays_with_the_first(found):
    found.register(Offering(simulators={"grid": Engine}), "first", "one")
    found.register(Offering(simulators={"grid": Task, "other": Engine}), "second", "two")
    assert found.factory("sim", "grid") is Engine
    assert found.names("sim") == ["grid", "other"]
    (failure,) = found.failures
    assert (failure.entry_point, failure.distribution) == ("second", "two")
    assert failure.reason == "sim 'grid' is taken by first of one"


def test_one_name_may_be_of_two_kinds(found):
    found.register(Offering(simulators={"grid": Engine}, executors={"grid": Engine}), "mine", "my-package")
    assert found.names("sim") == found.names("executor") == ["grid"]
    assert not found.failures


@pytest.mark.parametrize(
    ("offered", "reason"),
    [
        (RuntimeError("oh no"), "RuntimeError: oh no"),
        (["grid"], "ValueError"),
        (5, "TypeError"),
        ("grid", "ValueError"),
    ],
)
def test_a_hook_that_fails_takes_only_itself_along(found, offered, reason):
    found.register(Offering(simulators=offered, executors={"grid": Engine}), "mine", "my-package")
    (failure,) = found.failures
    assert failure.reason.startswith("hook 'simulators' failed: ")
    assert reason in failure.reason
    assert found.names("sim") == []
    assert found.names("executor") == ["grid"]


def test_a_hook_may_offer_nothing(found):
    found.register(Offering(simulators=None, tasks={}), "mine", "my-package")
    assert not found.failures
    assert not found.offers


def test_a_plugin_without_hooks_is_a_failure_that_names_its_file(monkeypatch, tmp_path):
    (tmp_path / "unhooked.py").write_text("def simulators(): return {}")
    monkeypatch.syspath_prepend(tmp_path)
    entry = importlib.metadata.EntryPoint("mine", "unhooked", PROJECT)
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda **_: [entry])
    found = Plugins()
    found.register(object(), "yours", "your-package")
    one, other = found.failures
    assert (one.entry_point, other.entry_point) == ("mine", "yours")
    assert one.reason.startswith(f"{tmp_path / 'unhooked.py'} implements no hook; possible: tasks, simulators, vlms, ")
    assert other.reason.startswith("builtins.object implements no hook")
    assert not found.offers


def test_plugins_can_be_switched_off(monkeypatch):
    monkeypatch.setenv("VLMGINEER_PLUGINS", "")
    assert not Plugins().offers
    monkeypatch.setenv("VLMGINEER_PLUGINS", "urdf, robotoolbench")
    found = Plugins()
    assert {offer.entry_point for offer in found.offers.values()} == {"urdf", "robotoolbench"}
    left_out = "no sim 'pybullet'; possible: none; VLMGINEER_PLUGINS=urdf, robotoolbench leaves out other plugins"
    with pytest.raises(UserError, match=left_out):
        found.create("sim", "pybullet")
    monkeypatch.setenv("VLMGINEER_PLUGINS", "vlmgineer")  # the distribution
    assert {key for key, offer in installed().offers.items() if offer.distribution == "vlmgineer"} <= set(
        Plugins().offers
    )
    monkeypatch.setenv("VLMGINEER_PLUGINS", "urfd")
    with pytest.raises(
        UsageError, match=r"no plugin or distribution 'urfd' in VLMGINEER_PLUGINS=urfd \(did you mean 'u"
    ):
        Plugins()


def test_what_is_switched_off_is_not_imported_and_is_reported(tmp_path):
    words = [sys.executable, "-c", "import core.plugins.__main__ as c, sys; c.main(); sys.exit('tasks' in sys.modules)"]
    env = os.environ | {"VLMGINEER_PLUGINS": "urdf"}
    done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert [line.split()[:2] for line in done.stdout.splitlines()[1:-1]] == [["tool", "urdf"]]
    assert done.stdout.splitlines()[-1] == "VLMGINEER_PLUGINS=urdf: other plugins are not loaded"


def test_a_hook_with_the_wrong_signature_is_a_failure(found):
    class Wrong:
        @hookimpl
        def simulators(self, extra):
            return {"grid": Engine}

    found.register(Wrong(), "mine", "my-package")
    (failure,) = found.failures
    assert "extra" in failure.reason
    assert not found.offers


@pytest.mark.parametrize("factory", [5, None, {"a": 1}])
def test_what_cannot_be_called_is_no_factory(found, factory):
    """Told where it is offered, or at the latest in one line where it is asked for."""
    found.register(Offering(simulators={"grid": factory}), "mine", "my-package")
    with pytest.raises(UserError, match="grid"):
        found.create("sim", "grid")


@pytest.mark.parametrize(
    ("factory", "reason"),
    [
        ("no_such_module:Engine", "No module named 'no_such_module'"),
        (f"{__name__}:Motor", "Motor"),
        (f"{__name__}", ""),
        ("", ""),
    ],
)
def test_a_named_factory_that_cannot_be_imported(found, factory, reason):
    found.register(Offering(simulators={"grid": factory}), "mine", "my-package")
    with pytest.raises(UserError, match=r"sim 'grid' of my-package can't be imported: ") as error:
        found.create("sim", "grid")
    assert reason in str(error.value)


# --- what is no part ---------------------------------------------------------------------------------------------


def test_a_part_that_lacks_a_method_is_told_with_its_plugin(found):
    class Half(Simulator):
        def rollout(self, task, jobs):
            return []

    found.register(Offering(simulators={"grid": Half}), "mine", "my-package")
    told = r"sim 'grid' of my-package \(hook 'simulators'\) can't be made: .*Half lacks render"
    with pytest.raises(UserError, match=told):
        found.create("sim", "grid")


def test_a_part_of_another_kind_is_refused(found):
    found.register(Offering(executors={"grid": Engine}), "mine", "my-package")
    told = r"executor 'grid' of my-package \(hook 'executors'\) makes a Engine, which is no core.interfaces.Executor"
    with pytest.raises(UserError, match=told):
        found.create("executor", "grid", {"grid": 1})


@pytest.mark.parametrize(("kind", "hook", "interface", "lacks"), [
    ("task", "tasks", Task, "name and no description and no goals"),
    ("vlm", "vlms", VLM, "model"),
])  # fmt: skip
def test_a_part_that_lacks_an_attribute(found, kind, hook, interface, lacks):
    methods = dict.fromkeys(interface.__abstractmethods__, lambda *_: None)
    bare = type("Bare", (interface,), methods)
    found.register(Offering(**{hook: {"bare": bare}}), "mine", "my-package")
    with pytest.raises(UserError, match=rf"{kind} 'bare' of my-package \(hook '{hook}'\): Bare has no {lacks}"):
        found.create(kind, "bare")


def test_a_listener_is_what_hears_an_event(found):
    class Deaf:
        pass

    class Wrong:
        @hookimpl
        def run_started(self, number):
            pass

    found.register(Offering(listeners={"deaf": Deaf, "wrong": Wrong}), "mine", "my-package")
    with pytest.raises(UserError, match=r"listener 'deaf' of my-package .* hears nothing: .*Deaf implements none of r"):
        found.create("listener", "deaf")
    with pytest.raises(UserError, match=r"listener 'wrong' of my-package .*number") as error:
        found.create("listener", "wrong")
    assert "\n" not in str(error.value)


def test_a_part_that_cannot_be_made_is_told_in_one_line(found):
    def make() -> Engine:
        raise RuntimeError("no licence")

    found.register(Offering(simulators={"grid": make}), "mine", "my-package")
    with pytest.raises(UserError, match=r"sim 'grid' of my-package .* can't be made: RuntimeError: no licence"):
        found.create("sim", "grid")


def test_whose_part_it_is(found):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    assert describe_part(found.create("sim", "grid", {"grid": 1})) == "sim 'grid' of my-package (hook 'simulators')"
    assert describe_part(Engine(1)) == f"{__name__}.Engine"


# --- configs ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("conf", "it gave 'conf'; expected a package that holds YAML files"),
        (5, "it gave 5"),
        ("pkg://no_such_package_anywhere", "there is no package 'no_such_package_anywhere'"),
        ("pkg://no_such_package_anywhere.conf", "No module named 'no_such_package_anywhere'"),
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


def test_a_part_without_a_config_file_has_its_signature(found, monkeypatch):
    def listener(color: str = "red", where: Path = ROOT) -> object:
        raise NotImplementedError

    found.register(Offering(simulators={"grid": Engine}, listeners={"shout": listener}), "mine", "my-package")
    found.register(Offering(executors={"gone": "no_such_module:Executor"}), "other", "other-package")
    monkeypatch.setattr(sources, "installed", lambda: found)
    cfg = load(
        "config", ["sim=grid", "sim.walls=[a]", "listener=[shout]", "listener.shout.color=blue", "executor=gone"]
    )
    assert dict(OmegaConf.to_container(cfg.sim)) == {"name": "grid", "grid": "???", "time_step": 0.01, "walls": ["a"]}
    assert cfg.listener == {"shout": {"color": "blue"}}  # what YAML can't say is left out
    assert cfg.executor == {"name": "gone"}
    assert load("config", ["sim=grid", "sim.grid=4"]).sim.grid == 4
    with pytest.raises(UsageError, match=r"no sim 'gird' \(did you mean 'grid'\?\); possible: grid, .*pybullet"):
        load("config", ["sim=gird"])


# --- settings ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"grid": 1, "timestep": 1}, r"'timestep' in sim=grid \(did you mean 'time_step'\?\); possible: grid, ti"),
        ({"time_step": 0.1}, "sim=grid: setting 'grid' is needed; settings: grid, time_step, walls"),
        ({"grid": 1, "time_step": "fast"}, "sim=grid: setting 'time_step' can't be 'fast': .*valid number"),
        ({"grid": 1.5}, "sim=grid: setting 'grid' can't be 1.5: .*integer"),
        ({"grid": 1, "walls": "north"}, "sim=grid: setting 'walls' can't be 'north': .*list"),
        ({"grid": None}, "sim=grid: setting 'grid' can't be None"),
    ],
)  # fmt: skip
def test_settings_are_checked_against_the_signature(found, settings, reason):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    with pytest.raises(UsageError, match=reason) as error:
        found.create("sim", "grid", settings)
    assert "\n" not in str(error.value)


def test_what_the_program_gives_is_no_setting(found):
    found.register(Offering(simulators={"grid": Engine}), "mine", "my-package")
    with pytest.raises(UsageError, match="no setting 'grid' in sim=grid; possible: time_step, walls"):
        found.create("sim", "grid", {"grid": 1}, grid=2)


def test_a_name_that_nobody_offers():
    with pytest.raises(
        UserError, match=r"no task 'OneBok' \(did you mean 'OneBook'\?\); possible: BringCube, .*OneBook"
    ):
        installed().create("task", "OneBok")
    with pytest.raises(UserError, match=r"no sim 'unreal'; possible: .*pybullet"):
        installed().factory("sim", "unreal")


def test_events_reach_listeners():
    heard = []

    class Listener:
        @hookimpl
        def generation_started(self, index):
            heard.append(index)

    hub = plugins.event_hub()
    hub.register(Listener())
    hub.hook.generation_started(index=3)
    hub.hook.run_ended()  # nobody listens
    assert heard == [3]


def test_listeners_that_hear_of_what_never_happens_are_told():
    class Listener:
        @hookimpl
        def generation_started(self, number):
            pass

    with pytest.raises(Exception, match="number"):
        plugins.event_hub().register(Listener())


# --- the command -----------------------------------------------------------------------------------------------


def test_python_m_core_plugins_lists_every_part(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    found = Plugins()
    found.register(Offering(simulators=RuntimeError("oh no")), "mine", "my-package")
    monkeypatch.setattr(command, "installed", lambda: found)
    monkeypatch.setattr(sys, "argv", ["core.plugins"])
    command.main()
    out = capsys.readouterr().out
    for kind, name in BUILT_IN:
        assert any(line.split()[:2] == [kind, name] for line in out.splitlines()), (kind, name)
    assert "failed mine (my-package): hook 'simulators' failed: RuntimeError: oh no" in out


def check(monkeypatch, found, *words):
    monkeypatch.setattr(command, "installed", lambda: found)
    monkeypatch.setattr(sys, "argv", ["core.plugins", *words])
    command.main()


def test_a_part_is_checked_by_its_name(monkeypatch, capfd):
    check(monkeypatch, Plugins(), "--check", "none")
    out = capfd.readouterr().out
    assert out.startswith("tool=none\n")
    assert out.count(": ok\n") == 5


def test_what_there_is_not_is_not_checked(monkeypatch, capsys):
    found = Plugins()
    found.register(Offering(simulators=RuntimeError("oh no")), "mine", "my-package")
    with pytest.raises(UsageError, match=r"no part, plugin or distribution 'nine' \(did you mean '[mn]\w*ne'"):
        check(monkeypatch, found, "--check", "nine")
    with pytest.raises(UserError, match="1 of the plugin's hooks failed"):
        check(monkeypatch, found, "--check", "my-package")
    assert "mine of my-package: hook 'simulators' failed: RuntimeError: oh no" in capsys.readouterr().out
    with pytest.raises(UsageError, match=r"can't read '--chek none'; usage"):
        check(monkeypatch, found, "--chek", "none")


def test_the_old_name_of_the_listeners_group_is_an_alias_that_warns(capsys):
    assert load("config", ["logger=[progress]", "~logger.progress"]).listener == {}
    assert "'logger' is called 'listener' now" in capsys.readouterr().err
    load("config", ["listener=[progress]", "task=BringCube"])
    assert capsys.readouterr().err == ""
