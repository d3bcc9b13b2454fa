import sys

import pytest
from omegaconf import OmegaConf

from core.config.compose import explain, load, part
from core.errors import UsageError, UserError
from core.plugins import Offer, installed
from core.run import main

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["+arm=ur5"], "no key 'arm' in the configuration"),
        (
            ["+nonsense.key=1"],
            "no key 'nonsense' in the configuration; possible: action, budget, evolution, ",
        ),
        (["++nonsense.key=1"], "no key 'nonsense' in the configuration"),
        (
            ["task.file=scene.yaml"],
            "task.file is a setting of task=file; add task=file",
        ),
        (["nonsense.key=1"], "no key 'nonsense' in the configuration"),
        (
            ["+budget.n_agnet=1"],
            "no key 'n_agnet' in budget (did you mean 'n_agent'?); possible: ",
        ),
        (
            ["task.paper.n_agnet=1"],
            "no key 'n_agnet' in task.paper (did you mean 'n_agent'?); possible: ",
        ),
    ],
)
def test_a_plus_adds_no_unknown_key(words, reason):
    with pytest.raises(UsageError) as error:
        load("config", words)
    assert str(error.value).startswith(reason)


def test_a_part_that_there_is_not_is_refused_before_others_are_imported(monkeypatch):
    def refuse(kind, name):
        raise AssertionError(f"{kind}={name} is imported")

    monkeypatch.setattr(installed(), "factory", refuse)
    with pytest.raises(UsageError, match=r"no sim 'mujco' .*possible: "):
        load("config", ["task=BringCube", "sim=mujco"])


@pytest.mark.parametrize(
    ("word", "due"),
    [
        ("task=/home/me/fetch.yaml", "task=file task.file=/home/me/fetch.yaml"),
        ("robot=arm.urdf", "robot=urdf robot.path=arm.urdf"),
    ],
)
def test_a_file_in_the_place_of_a_part_is_told_what_reads_it(word, due):
    with pytest.raises(UsageError, match=f"is a file; to read it, type {due}$"):
        load("config", [word])


@pytest.mark.parametrize(
    ("word", "reason"),
    [
        ("+vlm.model=x", "no key 'vlm' in the configuration; possible: .*designs, "),
        ("vlm=gemini", "has no group 'vlm'"),
    ],
)
def test_no_key_that_belongs_to_another_command_is_taken(word, reason):
    with pytest.raises(UsageError, match=reason):
        load("evaluate", [word])


def test_a_plus_before_a_key_that_is_there():
    assert load("config", ["++seed=3"]) == load("config", ["seed=3"])
    with pytest.raises(UsageError, match="Either remove \\+ prefix: 'seed=3'"):
        load("config", ["+seed=3"])


def test_a_plus_adds_a_setting_that_the_factory_checks():
    cfg = load(
        "config",
        ["+sim.walls=3", "+listener.shout={mark: no}", "++task.tool_kinds=[gripper]"],
    )
    assert cfg.listener.shout == {"mark": "no"}
    assert cfg.task.tool_kinds == ["gripper"]
    with pytest.raises(UsageError, match=r"no setting 'walls' in sim=\w+; possible: "):
        part("sim", cfg.sim).create()


def test_an_unknown_key_beside_a_sweep():
    with pytest.raises(UsageError) as caught:
        load("config", ["budget.n_agnet=2"])
    line = "no key 'n_agnet' in budget (did you mean 'n_agent'?); possible: "
    assert str(explain(caught.value.__cause__)).startswith(line)


def test_a_setting_without_a_value(tmp_path, monkeypatch, capsys):
    offer = Offer("executor", "remote", "theirs", "their-package", lambda address: None)
    monkeypatch.setitem(installed().offers, ("executor", "remote"), offer)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")  # set by main, and restored here
    monkeypatch.setattr(sys, "argv", ["core.run"])  # set by main, and restored here
    with pytest.raises(
        UsageError,
        match=r"executor\.address has no value; give one with executor\.address=VALUE",
    ):
        main(["executor=remote", f"hydra.run.dir={tmp_path / 'run'}"])
    assert capsys.readouterr() == ("", "")


def test_a_setting_that_refers_to_another_key():
    """Every command knows ``seed``; a key that a command lacks is one line."""
    config = load("evaluate", ["sim=mujoco", "sim.time_step=${seed}"])
    assert dict(part("sim", config.sim).settings)["time_step"] == 0
    with pytest.raises(
        UserError,
        match=r"^sim: its configuration can't be used here: Interpolation key 'film' not found$",
    ):
        part("sim", OmegaConf.create({"name": "mujoco", "time_step": "${film}"}))


@pytest.mark.parametrize("command", ["config", "evaluate"])
def test_a_protocol_sets_what_it_fixes_and_the_command_line_goes_first(command):
    free = load(command, [])
    assert (free.protocol.name, free.material.most_g, free.task.variation) == (
        "none",
        None,
        "none",
    )
    config = load(
        command,
        ["material.most_g=5", "protocol=varied", "task=OneBook", "action=waypoints"],
    )
    assert (config.task.name, config.task.variation, config.action.name) == (
        "OneBook",
        "wide",
        "waypoints",
    )
    assert (config.material.name, config.material.most_g, config.material.infill) == (
        "pla",
        5,
        0.2,
    )
    assert config.rollout.perception == {
        "position": 0.002,
        "yaw": 0.01,
        "height": 0.0,
        "look_s": 0.5,
        "camera": "fixed",
    }
    for key in config.protocol.fixed:
        assert OmegaConf.select(config, key) is not None, key
    tracks = {
        offer.entry_point
        for (kind, _), offer in installed().offers.items()
        if kind == "task"
    }
    assert len(config.protocol.tracks) == 2
    assert "robotoolbench" in tracks


def test_a_key_that_is_not_there_and_several_values_are_told_by_the_words():
    with pytest.raises(UsageError, match=r"'sim=mujoco,sapien' .* quote the value"):
        load("evaluate", ["seed=3", "sim=mujoco,sapien"])
    with pytest.raises(UsageError, match=r"'seed=3,4' .* add -m to your"):
        load("config", ["sim=mujoco", "seed=3,4"])


def test_a_config_that_cannot_be_composed_is_one_line_whatever_the_words():
    with pytest.raises(UsageError, match="Cannot find primary config 'missing'"):
        load("missing", ["seed=3"])
