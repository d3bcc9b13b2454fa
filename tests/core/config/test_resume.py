"""The settings that may change as a run goes on; `tests/test_resume.py` goes on with whole runs."""

import copy

import pytest
from omegaconf import OmegaConf

from core.config.compose import load
from core.config.resume import changed, refuse_other_run, refuse_stored_receivers
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
        ("sim=mujoco", "another sim.name; choose another folder"),
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


RECEIVERS = [
    {"vlm": {"api_base": "http://evil.example/v1"}},
    {"vlm": {"api_base": "evil.example"}},
    {"vlm": {"model": "huggingface/https://evil.example"}},
    {"vlm": {"name": "gemini", "model": "zai/glm-4.6"}},
    {"vlm": {"name": "litellm", "model": "gemini/gemini-2.5-pro"}},
    {"vlm": {"name": "nonesuch", "model": "mine"}},
    {"executor": {"address": "10.0.0.1:6379"}},
    {"listener": {"rerun": {"connect": "rerun+http://evil.example"}}},
]


@pytest.mark.parametrize("change", RECEIVERS)
def test_stored_addresses_and_models_are_used_only_when_repeated(change):
    with pytest.raises(UserError, match="if you trust that, repeat it: ") as error:
        refuse_stored_receivers(change, ["vlm.timeout_s=5"])
    refuse_stored_receivers(change, [str(error.value).partition("repeat it: ")[2]])


def test_all_that_is_to_be_repeated_is_said_at_once_and_the_usual_is_not():
    with pytest.raises(
        UserError,
        match=r"repeat it: vlm\.model=openai/mine vlm\.api_base=http://evil\.example$",
    ):
        refuse_stored_receivers(
            {"vlm": {"model": "openai/mine", "api_base": "http://evil.example"}}, []
        )
    refuse_stored_receivers(
        {"vlm": {"name": "gemini", "api_base": None, "model": "gemini/gemini-2.5-pro"}},
        [],
    )


@pytest.mark.parametrize(
    ("key", "value"), [("api_base", "http://evil.example"), ("model", "zai/glm-4.6")]
)
def test_receivers_in_a_list_are_used_only_when_it_is_repeated(key, value):
    config = {
        "vlm": {
            "name": "ensemble",
            "members": ["gemini", {"name": "openai", key: value}],
        }
    }
    with pytest.raises(
        UserError, match=rf"leads to {value}.*repeat it: vlm\.members\.{key}={value}"
    ):
        refuse_stored_receivers(config, ["vlm.max_cost_usd=5"])
    refuse_stored_receivers(config, ["vlm.members=[gemini,openai]"])
