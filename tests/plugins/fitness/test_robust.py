"""The lowest mean reward over perturbed scenes and engines; the engines are PyBullet with different settings."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from omegaconf import OmegaConf

from core.config.compose import engines, load, part
from core.designs.reading import load_designs, read_designs
from core.errors import UserError
from core.plugins import installed
from core.simulation.play import play
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from tests.plugins.fitness.judging import judged
from tests.support.conditions import COARSE, CONDITION, TASK

ROOT = Path(__file__).parents[3]


def solution():
    task = TASK.create()
    document = load_designs(ROOT / "tests" / "tasks" / "solutions" / "BringCube.json")
    return read_designs(document, installed().create("tool", "urdf"), task)[0]


def fitness(config):
    return part("fitness", OmegaConf.create(config)).create(condition=CONDITION)


def test_transfer_and_robust_begin_alike():
    transfer = yaml.safe_load((ROOT / "conf" / "transfer.yaml").read_text())
    robust = load("config", ["fitness=robust"]).fitness
    assert all(
        transfer[key] == robust[key] for key in ("sims", "seeds", "perturbation")
    )


def test_the_prompt_says_what_counts():
    ranges = {"position": 0.01, "yaw": 0.1, "mass": 0.2, "friction": 0.3}
    many = {
        "name": "robust",
        "sims": ["pybullet", {"name": "pybullet", "time_step": 0.002}],
        "perturbation": ranges,
    }
    text = fitness(many).instructions()
    assert "3 times in each of the engines pybullet, pybullet time_step=0.002" in text
    assert (
        "moved by up to 0.01 m along x and along y and turned by up to 0.1 rad" in text
    )
    assert "masses differ by up to 20%, friction by up to 30%" in text
    assert "the lowest of the engines' mean rewards" in text
    one = fitness({"name": "robust", "sims": ["pybullet"], "seeds": [4]}).instructions()
    assert "once in the engine pybullet" in one
    assert "the mean of its rewards" in one
    assert not fitness({"name": "nominal"}).instructions()


@pytest.mark.parametrize(
    ("config", "said"),
    [
        ({"name": "robus"}, r"no fitness 'robus' \(did you mean 'robust'\?\); possible: buildable, lay"),
        ({"name": "nominal", "seeds": [1]}, "no setting 'seeds' in fitness=nominal"),
        ({"name": "robust", "seeds": ["a"]}, "fitness=robust: setting 'seeds' can't be"),
        ({"name": "robust", "seeds": []}, "setting 'seeds' can't be"),
        ({"name": "robust", "seeds": [-1]}, "setting 'seeds' can't be"),
        ({"name": "robust", "perturbation": {"mass": 2}}, "'perturbation' .*: mass: must be less than 1, got 2"),
        ({"name": "robust", "sims": []}, "sim: name at least one sim"),
        ({"name": "robust", "sims": ["pybulet"]}, r"no sim 'pybulet' \(did you mean 'pybullet'\?\); possible: "),
        ({"name": "robust", "sims": ["pybullet", "pybullet"]}, "sim: 'pybullet' is repeated"),
        ({"name": "robust", "sims": [{"time_step": 0.1}]}, "names no sim"),
        ({"name": "robust", "sims": [{"name": "sapien", "timestep": 1}]}, r"'timestep' in sim=sapien \(did you mean"),
        ({"name": "robust", "sims": [{"name": "sapien", "time_step": 1}]}, "sim.time_step must be at most"),
    ],
)  # fmt: skip
def test_a_wrong_setting_is_reported(config, said):
    with pytest.raises(UserError, match=said) as error:
        fitness(config)
    assert "\n" not in str(error.value)


def test_a_wrong_key_is_reported():
    with pytest.raises(
        UserError,
        match=r"no key 'weight' in fitness.perturbation; possible: friction, mass, position, yaw",
    ):
        load("config", ["fitness=robust", "fitness.perturbation.weight=1"])


@pytest.mark.thorough
def test_robust_tries_every_change_in_every_engine():
    config = {
        "name": "robust",
        "sims": ["pybullet", COARSE],
        "seeds": [3, 5],
        "perturbation": {"position": 0.02},
    }
    earns = fitness(config)
    assert pickle.loads(pickle.dumps(earns.conditions())) == earns.conditions()
    candidate = solution()
    slower = replace(
        candidate,
        action=1,
        plan=np.concatenate([candidate.plan.poses, candidate.plan.poses[-1:]]),
    )
    evaluations = judged(earns, candidate, slower)
    for evaluation in evaluations:
        rewards = evaluation.by_engine
        for (engine, sim), draw in zip(
            engines(config["sims"]).items(), [0, 1], strict=True
        ):
            change = Perturbation(PerturbationRange(position=0.02), [3, 5][draw])
            (alone,) = play(
                replace(CONDITION, sim=sim, change=change), [evaluation.candidate]
            )
            assert rewards[engine][draw] == alone.reward
        assert evaluation.reward == min(map(np.mean, rewards.values()))
        assert evaluation.distance_m > 0.3
        assert evaluation.observation is None
    rewards = np.array(list(evaluations[0].by_engine.values()))
    assert len(np.unique(rewards)) == 4
    assert rewards.min() > 0.9
