"""The settings that may change as a run goes on; `tests/test_resume.py` goes on with whole runs."""

import copy

import pytest
from omegaconf import OmegaConf

from core.config.compose import load
from core.config.resume import changed, hydra_config
from core.errors import UsageError, UserError


@pytest.fixture(scope="module")
def began():
    return OmegaConf.to_container(load("config", ["budget.n_iteration=2"]))


def test_what_has_no_effect_on_the_past_may_change(began):
    words = ["executor.workers=3", "listener=[progress]", "budget.n_iteration=4", "film=false", "vlm.samples=3"]
    cfg = changed(began, words)
    assert (cfg.executor.workers, cfg.budget.n_iteration, cfg.film) == (3, 4, False)
    assert set(cfg.listener) == {"progress"}
    assert cfg.vlm.samples == 3
    assert changed(began, []) == OmegaConf.create(began)


@pytest.mark.parametrize(
    ("word", "reason"),
    [
        ("seed=6", "seed=6: a run goes on as it began; what may change: executor, listener, vlm"),
        ("vlm.name=replay", "a run goes on as it began"),
        ("~listener", "a run goes on as it began"),
        ("budget.n_iteration=1", "can only be raised; it is 2"),
        ("film=true,false", "one run goes on, with one value for each setting"),
        ("executor=nonesuch", "nonesuch"),
    ],
)
def test_the_rest_may_not(began, word, reason):
    with pytest.raises(UsageError, match=reason):
        changed(began, [word])


def test_refinement_is_added_once_and_stays_last(began):
    refined = OmegaConf.to_container(changed(began, ["evolution.refine=24"]))
    assert refined["evolution"]["refine"] == 24
    with pytest.raises(UsageError, match=r"evolution\.refine of a run that goes on can't change any more; it is 24"):
        changed(refined, ["evolution.refine=48"])
    with pytest.raises(UsageError, match="refinement comes last"):
        changed(refined, ["budget.n_iteration=3"])


def test_a_folder_without_a_run(tmp_path):
    (tmp_path / "sweep").mkdir()
    (tmp_path / "sweep" / "run.sqlite").touch()
    with pytest.raises(UserError, match=r"holds no run; there is one in .*sweep"):
        hydra_config(tmp_path)


@pytest.mark.parametrize(("group", "key"), [("budget", "n_tool"), (None, "executor")])
def test_a_configuration_that_lacks_a_setting(began, group, key):
    config = copy.deepcopy(began)
    del (config[group] if group else config)[key]
    with pytest.raises(UserError, match=f"can't be used: it lacks {group + '.' if group else ''}{key}$"):
        changed(config, [])
