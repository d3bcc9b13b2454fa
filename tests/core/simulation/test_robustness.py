"""Rewards in several engines and in perturbed scenes; the engines are PyBullet with different settings."""

import json
import pickle
import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hydra import initialize_config_module
from omegaconf import OmegaConf

from core.config.compose import load, part
from core.config.settings import PerturbationRange
from core.design import Candidate, Component, Evaluation, Tool
from core.designs.reading import load_designs, read_designs
from core.designs.rules import SpawnRules
from core.errors import UserError
from core.geometry import Box, Pose
from core.interfaces import RolloutSettings
from core.plugins import installed
from core.search.orchestration import run
from core.simulation.robustness import engines, perturbed, worst
from core.simulation.rollout import Evaluator, Part

ROOT = Path(__file__).parents[3]
COARSE = {"name": "pybullet", "time_step": 0.004}
TASK = Part("task", "BringCube")
BENCH = Evaluator(TASK, Part("sim", "pybullet"), 0, RolloutSettings())


def solution():
    task = TASK.create()
    document = load_designs(ROOT / "tests" / "tasks" / "solutions" / "BringCube.json")
    return read_designs(document, installed().create("tool", "urdf"), SpawnRules(task, 0))[0]


# --- the choices and their settings -----------------------------------------------------------------------------


def test_transfer_and_robust_begin_alike():
    transfer = yaml.safe_load((ROOT / "conf" / "transfer.yaml").read_text())
    robust = yaml.safe_load((ROOT / "conf" / "fitness" / "robust.yaml").read_text())
    assert all(transfer[key] == robust[key] for key in ("sims", "seeds", "perturbation"))


def fitness(config, evaluator):
    return part("fitness", OmegaConf.create(config)).create(evaluator=evaluator)


def test_nominal_is_the_default_and_passes_on_what_the_evaluator_says():
    assert load("config", []).fitness == {"name": "nominal"}
    nominal = fitness({"name": "nominal"}, lambda candidates: [f"evaluation of {c}" for c in candidates])
    assert nominal(["a", "b"]) == ["evaluation of a", "evaluation of b"]


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ({"name": "robus"}, r"no fitness 'robus' \(did you mean 'robust'\?\); possible: nominal, robust"),
        ({"name": "nominal", "seeds": [1]}, "no setting 'seeds' in fitness=nominal"),
        ({"name": "robust", "seeds": ["a"]}, "fitness=robust: setting 'seeds' can't be"),
        ({"name": "robust", "seeds": []}, "seeds must be one or more different numbers"),
        ({"name": "robust", "seeds": [1, 1]}, "seeds must be one or more different numbers"),
        ({"name": "robust", "seeds": [-1]}, "seeds must be one or more different numbers"),
        ({"name": "robust", "perturbation": {"mass": 2}}, "perturbation.mass must be 0 or greater and less than 1"),
        ({"name": "robust", "sims": []}, "sims: name at least one engine"),
        ({"name": "robust", "sims": ["pybulet"]}, r"no sim 'pybulet' \(did you mean 'pybullet'\?\); possible: "),
        ({"name": "robust", "sims": ["pybullet", "pybullet"]}, "sims: 'pybullet' is repeated"),
        ({"name": "robust", "sims": [{"time_step": 0.1}]}, "names no engine"),
        ({"name": "robust", "sims": [COARSE | {"timestep": 1}]}, r"'timestep' in sim=pybullet \(did you mean"),
        ({"name": "robust", "sims": [COARSE | {"time_step": 1}]}, "sim.time_step must be at most"),
    ],
)  # fmt: skip
def test_a_wrong_setting_is_reported(config, said):
    with pytest.raises(UserError, match=said) as error:
        fitness(config, BENCH)
    assert "\n" not in str(error.value)


def test_a_wrong_key_is_reported():
    with pytest.raises(
        UserError, match=r"no key 'weight' in fitness.perturbation; possible: friction, mass, position, yaw"
    ):
        load("config", ["fitness=robust", "fitness.perturbation.weight=1"])


def test_engines_are_set_as_the_configuration_says_but_for_what_an_entry_says():
    usual = part("sim", load("evaluate", []).sim)
    found = engines(["pybullet", COARSE])
    assert list(found) == ["pybullet", "pybullet time_step=0.004"]
    assert found["pybullet"] == usual
    assert dict(found["pybullet time_step=0.004"].settings) == dict(usual.settings) | {"time_step": 0.004}


def test_engines_may_be_named_within_a_job_of_hydras():
    with initialize_config_module("conf", version_base="1.3"):
        assert engines(["pybullet"])["pybullet"] == part("sim", load("evaluate", []).sim)


def test_the_engine_of_a_run_keeps_its_settings():
    chosen = Part("sim", "pybullet", (("solver_iterations", 20),))
    assert engines(["pybullet"], chosen) == {"pybullet": chosen}
    both = engines([COARSE], chosen)["pybullet time_step=0.004"]
    assert dict(both.settings) == {"solver_iterations": 20, "time_step": 0.004}


# --- one evaluation out of many ---------------------------------------------------------------------------------

CANDIDATE = Candidate(Tool(), np.zeros((1, 6)))


def earned(reward, status="ok", reason="", **more):
    return Evaluation(replace(CANDIDATE), status, reward, reason=reason, **more)


def test_the_worst_engines_mean_counts():
    good, bad = [earned(1.0), earned(0.8)], [earned(0.2, distance_m=3.0), earned(0.6)]
    evaluation = worst(CANDIDATE, {"one": good, "other": bad})
    assert evaluation.candidate is CANDIDATE
    assert evaluation.status == "ok"
    assert evaluation.reward == pytest.approx(0.4)
    assert evaluation.distance_m == 3.0
    assert not evaluation.warnings
    figures = evaluation.details["engines"]
    assert figures["one"] == {"mean": pytest.approx(0.9), "std": pytest.approx(0.1), "rewards": [1.0, 0.8]}
    assert figures["other"]["rewards"] == [0.2, 0.6]


def test_a_trial_that_fails_counts_nothing_and_is_reported():
    broken = earned(0.0, "failed", "it blew up")
    evaluation = worst(CANDIDATE, {"one": [earned(1.0), earned(1.0)], "other": [earned(1.0), broken]})
    assert (evaluation.status, evaluation.reward) == ("ok", 0.5)
    assert evaluation.warnings == ("other, change 2 of 2: failed: it blew up",)
    everywhere = worst(CANDIDATE, {"one": [earned(0.9)], "other": [broken]})
    assert (everywhere.status, everywhere.reward, everywhere.reason) == ("ok", 0.0, "")


def test_what_is_refused_everywhere_is_refused():
    refused = earned(0.0, "rejected", "too long")
    evaluation = worst(CANDIDATE, {"one": [refused], "other": [refused]})
    assert (evaluation.status, evaluation.reason, evaluation.reward) == ("rejected", "too long", 0.0)


# --- real engines -----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_robust_tries_every_change_in_every_engine():
    config = {"name": "robust", "sims": ["pybullet", COARSE], "seeds": [3, 5], "perturbation": {"position": 0.02}}
    earns = fitness(config, BENCH)
    there = pickle.loads(pickle.dumps(earns))
    candidate = solution()
    slower = replace(candidate, action=1, plan=np.concatenate([candidate.plan, candidate.plan[-1:]]))
    evaluations = there([candidate, slower])
    assert [e.candidate for e in evaluations] == [candidate, slower]
    for evaluation in evaluations:
        figures = evaluation.details["engines"]
        for (engine, sim), draw in zip(engines(config["sims"]).items(), [0, 1], strict=True):
            bench = perturbed(replace(BENCH, sim=sim), PerturbationRange(position=0.02), [3, 5][draw])
            (alone,) = bench([evaluation.candidate])
            assert figures[engine]["rewards"][draw] == alone.reward
        assert evaluation.reward == min(engine["mean"] for engine in figures.values())
        assert json.loads(json.dumps(figures)) == figures
        assert evaluation.distance_m > 0.3
    rewards = np.array([engine["rewards"] for engine in evaluations[0].details["engines"].values()])
    assert len(np.unique(rewards)) == 4
    assert rewards.min() > 0.9


def test_a_tool_that_starts_in_a_body_that_was_moved_is_refused_there():
    """One that ends a millimetre from the cube's near face: some changes bring the cube nearer."""
    home = TASK.create().home
    reach, down, thick = 1.0 - 0.035 - 0.001 - home.position[0], home.position[2] - 0.035, 0.01
    post = Component("post", "panda_virtual", Pose.xyz_rpy((0, 0, -down / 2)), Box((thick, thick, down)))
    bar = Component("bar", "post", Pose.xyz_rpy((reach / 2, 0, -down / 2)), Box((reach, thick, thick)))
    tool = Tool((post, bar))
    SpawnRules(TASK.create(), 0).check(tool)  # clear of the scene as it is
    still = Candidate(tool, np.array([[*home.position, *home.rpy]]))
    ranges = PerturbationRange(position=0.005, yaw=0.0)
    tried = {draw: perturbed(BENCH, ranges, draw)([still])[0] for draw in range(8)}
    refused = {draw for draw, evaluation in tried.items() if evaluation.status == "rejected"}
    cubes = {draw: perturbed(BENCH, ranges, draw).task.create().scene(0)["cube"].pose.position for draw in tried}
    near = {draw for draw, (x, _, _) in cubes.items() if x < 1.0 - 0.001}
    assert refused == near
    assert 0 < len(refused) < 8
    assert all(tried[draw].reason.startswith("in the perturbed scene, component 'bar' starts") for draw in near)


@pytest.mark.slow
def test_a_run_selects_by_it_and_keeps_what_each_engine_gave(tmp_path):
    words = ["task=BringCube", "film=false", "listener=[]", "executor.workers=1", "sim.solver_iterations=30"]
    words += ["budget.n_agent=1", "budget.n_tool=1", "budget.n_action=2", "budget.n_iteration=0"]
    words += ["fitness=robust", "fitness.sims=[pybullet]", "fitness.seeds=[4]"]
    result = run(load("config", words), tmp_path / "run")
    evaluations = [e for g in result.generations for e in g.evaluations]
    sim = part("sim", load("evaluate", ["sim.solver_iterations=30"]).sim)
    bench = perturbed(Evaluator(TASK, sim, 0, RolloutSettings()), PerturbationRange(), 4)
    again = bench([e.candidate for e in evaluations])
    assert [e.reward for e in evaluations] == [e.reward for e in again]
    with sqlite3.connect(tmp_path / "run" / "run.sqlite") as database:
        rows = dict(database.execute("SELECT candidate, details FROM evaluations").fetchall())
    for evaluation in evaluations:
        assert json.loads(rows[evaluation.candidate.id])["engines"]["pybullet"]["rewards"] == [evaluation.reward]
