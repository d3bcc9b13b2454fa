"""The settings that may change as a run goes on; `tests/test_resume.py` goes on with whole runs."""

import copy

import pytest
from omegaconf import OmegaConf

from core.config.compose import load
from core.config.resume import changed, refuse_other_run
from core.errors import UsageError, UserError

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def began():
    return OmegaConf.to_container(load("config", ["budget.n_iteration=2"]))


def test_what_has_no_effect_on_the_past_may_change(began):
    words = [
        "executor.workers=3",
        "listener=[progress]",
        "budget.n_iteration=4",
        "film=false",
        "vlm.samples=3",
        "budget.final_s=5",
    ]
    cfg = changed(began, words)
    assert (cfg.executor.workers, cfg.budget.n_iteration, cfg.film) == (3, 4, False)
    assert set(cfg.listener) == {"progress"}
    assert cfg.budget.final_s == 5
    assert cfg.vlm.samples == 3
    assert changed(began, []) == OmegaConf.create(began)


@pytest.mark.parametrize(
    ("word", "reason"),
    [
        ("seed=6", "another seed; choose another folder"),
        ("sim=sapien", "another sim.name; choose another folder"),
        ("vlm=replay", "another vlm.name; choose another folder"),
        ("budget.k_top=9", "another budget.k_top; choose another folder"),
        ("budget.n_iteration=1", "can only be raised; it is 2"),
    ],
)
def test_a_run_of_other_settings_does_not_go_on(tmp_path, word, reason):
    stored = load("config", ["budget.n_iteration=2"])
    began = OmegaConf.to_container(stored, resolve=True)
    free = ["executor.workers=3", "listener=[progress]", "film=false", "+vlm.samples=3"]
    words = ["budget.n_iteration=2", *free]
    refuse_other_run(began, load("config", words), tmp_path)
    with pytest.raises(UserError, match=reason):
        refuse_other_run(began, load("config", [*words, word]), tmp_path)


@pytest.mark.parametrize(
    ("word", "reason"),
    [
        (
            "seed=6",
            "seed=6: a run goes on as it began; what may change: executor, listener, vlm",
        ),
        ("vlm.name=replay", "a run goes on as it began"),
        ("vlm=offline", "a run goes on as it began"),
        ("budget.k_top=9", "a run goes on as it began"),
        ("film=perhaps", "perhaps"),
        ("nonsense", "nonsense"),
        ("~listener", "a run goes on as it began"),
        ("budget.n_iteration=1", "can only be raised; it is 2"),
        ("budget.n_rollouts=100", "or lifted with null; it is null"),
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
    assert changed(refined, ["evolution.refine=48"]).evolution.refine == 48
    with pytest.raises(
        UsageError,
        match=r"evolution\.refine of a run that goes on can only be raised; it is 24",
    ):
        changed(refined, ["evolution.refine=12"])
    with pytest.raises(UsageError, match="refinement comes last"):
        changed(refined, ["budget.n_iteration=3"])


@pytest.mark.parametrize(("group", "key"), [("budget", "n_tool"), (None, "executor")])
def test_a_configuration_that_lacks_a_setting(began, group, key):
    config = copy.deepcopy(began)
    del (config[group] if group else config)[key]
    with pytest.raises(
        UserError,
        match=f"can't be used by this version: it lacks {group + '.' if group else ''}{key}$",
    ):
        changed(config, [])
