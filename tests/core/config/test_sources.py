from pathlib import Path

import pytest
import yaml
from omegaconf import MISSING, OmegaConf

from core.config import sources
from core.config.compose import load, part
from core.errors import UsageError
from core.hooks import hookimpl
from core.interfaces import Task
from core.plugins import KINDS, installed
from core.plugins.kinds import PAPER_BUDGET
from core.plugins.registry import Plugins
from tests.core.plugins.offering import Engine, Offering
from tests.support.rare import rare

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[3]
# It has no settings.
BUILT_IN = sorted(
    part for part in installed().offers if part[0] in KINDS.keys() - {"command"}
)
FEW = [
    ("evolution", "vlmgineer"),
    ("executor", "local"),
    ("listener", "rerun"),
    ("robot", "panda"),
    ("sim", "mujoco"),
    ("task", "OneBook"),
    ("vlm", "anthropic"),
]


@pytest.mark.parametrize(("kind", "name"), rare(BUILT_IN, *FEW))
def test_a_config_has_the_defaults_of_the_signature_and_its_file_only_what_differs(
    kind, name
):
    known = sources.defaults(kind, name)
    file = ROOT / "conf" / kind / f"{name}.yaml"
    document = yaml.safe_load(file.read_text()) if file.exists() else {"name": name}
    assert document.pop("name") == name
    assert {
        key for key, value in document.items() if known.get(key, MISSING) == value
    } == set()
    word = f"{kind}=[{name}]" if kind == "listener" else f"{kind}={name}"
    composed = OmegaConf.to_container(load("config", [word])[kind])
    if kind == "listener":  # several at once: the name is the key
        assert composed == {name: known}
        return
    assert composed.pop("name") == name
    nested = known.get("paper", {}) | document.pop("paper", {})
    expected = known | document | ({"paper": nested} if nested else {})
    assert composed == expected


@pytest.fixture
def extended(monkeypatch):
    """The built-in plugins, and those that the test registers."""
    plugins = Plugins()
    monkeypatch.setattr(sources, "installed", lambda: plugins)
    return plugins


def test_every_config_names_a_part_that_there_is():
    for kind in KINDS:
        for file in (ROOT / "conf" / kind).glob("*.yaml"):
            names = yaml.safe_load(file.read_text())
            for name in names if kind == "listener" else [names["name"]]:
                assert (kind, name) in installed().offers, file


def test_a_part_without_a_config_file_has_its_signature(extended):
    def listener(color="red", where=ROOT):
        raise NotImplementedError

    extended.register(
        Offering(simulators={"grid": Engine}, listeners={"shout": listener}),
        "mine",
        "my-package",
    )
    extended.register(
        Offering(executors={"gone": "no_such_module:Executor"}),
        "other",
        "other-package",
    )
    cfg = load(
        "config",
        [
            "sim=grid",
            "sim.walls=[a]",
            "listener=[shout]",
            "listener.shout.color=blue",
            "executor=gone",
        ],
    )
    assert dict(OmegaConf.to_container(cfg.sim)) == {
        "name": "grid",
        "grid": "???",
        "time_step": 0.01,
        "walls": ["a"],
    }
    # What YAML can't say is left out.
    assert cfg.listener == {"shout": {"color": "blue"}}
    assert cfg.executor == {"name": "gone"}
    assert load("config", ["sim=grid", "sim.grid=4"]).sim.grid == 4
    with pytest.raises(
        UsageError,
        match=r"no sim 'gird' \(did you mean 'grid'\?\); possible: grid, .*pybullet",
    ):
        load("config", ["sim=gird"])
    with pytest.raises(
        UsageError,
        match=r"no key 'colour' in listener.shout \(did you mean 'color'\?\)",
    ):
        load("config", ["listener=[shout]", "listener.shout.colour=blue"])


@pytest.fixture
def brought(extended, monkeypatch, tmp_path):
    """A plugin whose YAML files list none of its task's settings."""
    folder = tmp_path / "brought" / "conf" / "task"
    folder.mkdir(parents=True)
    for package in (folder.parent, folder.parents[1]):
        (package / "__init__.py").touch()
    (folder / "Hinted.yaml").write_text("name: Hinted\ntool_kinds: [gripper]\n")
    (folder / "Far.yaml").write_text("defaults: [Hinted]\nhint: far\n")
    group = folder.parent / "experiment"
    group.mkdir()
    (group / "big.yaml").write_text("# @package _global_\nseed: 7\n")
    monkeypatch.syspath_prepend(tmp_path)

    def make(size, hint="none", grid=ROOT):
        raise NotImplementedError(size, hint, grid)

    class Brings(Offering):
        @hookimpl
        def config_path(self):
            return "pkg://brought.conf"

    extended.register(Brings(tasks={"Hinted": make, "Far": Task}), "mine", "my-package")


def test_settings_that_a_config_file_does_not_list(brought):
    whole = OmegaConf.to_container(load("evaluate", ["task=Hinted"]).task)
    assert whole.pop("paper") == PAPER_BUDGET
    assert whole == {
        "name": "Hinted",
        "tool_kinds": ["gripper"],
        "size": "???",
        "hint": "none",
    }
    for word in ("task.hint=away", "++task.hint=away"):
        cfg = load("evaluate", ["task=Hinted", word])
        assert part("task", cfg.task).settings == (("hint", "away"),)
        assert cfg.task.tool_kinds == ["gripper"]
    assert part(
        "task", load("evaluate", ["task=Hinted", "task.size=3"]).task
    ).settings == (
        ("size", 3),
        ("hint", "none"),
    )
    with pytest.raises(
        UsageError,
        match=r"no key 'hnt' in task \(did you mean 'hint'\?\); possible: hint, name, ",
    ):
        load("evaluate", ["task=Hinted", "task.hnt=away"])
    with pytest.raises(
        UsageError, match="no key 'hint' in task; possible: name, paper, tool_kinds"
    ):
        load("evaluate", ["task.hint=away"])


def test_a_config_file_over_another_one_keeps_what_that_says(brought):
    whole = OmegaConf.to_container(load("evaluate", ["task=Far"]).task)
    assert whole.pop("paper") == PAPER_BUDGET
    assert whole == {
        "name": "Hinted",
        "tool_kinds": ["gripper"],
        "size": "???",
        "hint": "far",
    }
    assert dict(
        part("task", load("evaluate", ["task=Far", "task.size=3"]).task).settings
    ) == {"size": 3, "hint": "far"}


def test_a_config_group_of_a_plugin_can_be_added(brought):
    assert load("config", ["+experiment=big"]).seed == 7
    assert load("config", []).seed == 0
