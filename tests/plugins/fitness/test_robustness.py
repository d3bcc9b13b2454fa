"""Rewards in several engines and in perturbed scenes; the engines are PyBullet with different settings."""

from dataclasses import replace

import numpy as np
import pytest
from hydra import initialize_config_module

from core.config.compose import engines, load, part
from core.design import Candidate, Component, Tool
from core.designs.start import SpawnRules
from core.geometry import Box, Capsule, Compound, Mesh, Pose
from core.interfaces import Trial, Waypoints
from core.plugins import PluginPart
from core.simulation.play import play
from core.trial import Evaluation, Where
from core.values.margins import Margin
from core.values.observations import Observation
from plugins.fitness.perturbation_range import PerturbationRange
from plugins.fitness.robustness import Perturbation
from plugins.fitness.several import score_by_worst_engine
from tests.support.conditions import COARSE, CONDITION, TASK

# --- the choices and their settings -----------------------------------------------------------------------------


def test_engines_are_set_as_the_configuration_says_but_for_what_an_entry_says():
    usual = part("sim", load("evaluate", []).sim)
    found = engines(["pybullet", COARSE])
    assert list(found) == ["pybullet", "pybullet time_step=0.004"]
    assert found["pybullet"] == usual
    assert dict(found["pybullet time_step=0.004"].settings) == dict(usual.settings) | {
        "time_step": 0.004
    }


def test_engines_may_be_named_within_a_job_of_hydras():
    with initialize_config_module("conf", version_base="1.3"):
        assert engines(["pybullet"])["pybullet"] == part(
            "sim", load("evaluate", []).sim
        )


def test_the_engine_of_a_run_keeps_its_settings():
    chosen = PluginPart("sim", "pybullet", (("solver_iterations", 20),))
    assert engines(["pybullet"], chosen) == {"pybullet": chosen}
    both = engines([COARSE], chosen)["pybullet time_step=0.004"]
    assert dict(both.settings) == {"solver_iterations": 20, "time_step": 0.004}


# --- one score of many trials -----------------------------------------------------------------------------------

CANDIDATE = Candidate(Tool(), Waypoints(np.zeros((1, 6))))


def earned(reward, engine="one", change=0, **fields):
    return Trial(
        Where("BringCube", engine, 0, change), CANDIDATE.id, reward=reward, **fields
    )


def went(distance_m, **others):
    return {"measured": {"distance_m": distance_m, **others}}


def evaluated(*trials):
    return Evaluation(CANDIDATE, trials, score_by_worst_engine(trials))


def test_the_worst_engines_mean_counts():
    good = earned(1.0, **went(3.0)), earned(0.8, **went(4.0))
    bad = (
        earned(0.2, "other", **went(3.0, ik_error_m=0.5)),
        earned(0.6, "other", **went(6.0)),
    )
    evaluation = evaluated(*good, *bad)
    assert evaluation.status == "ok"
    assert evaluation.reward == pytest.approx(0.4)
    # The mean, and the worst trial's.
    assert (evaluation.distance_m, evaluation.shown.figure("ik_error_m")) == (4.0, 0.5)
    assert not evaluation.warnings
    assert evaluation.combined
    assert evaluation.by_engine == {"one": (1.0, 0.8), "other": (0.2, 0.6)}


def test_of_equal_trials_the_one_with_the_least_margin_is_shown():
    trials = [
        earned(1.0, margins=(Margin.clearance("vase", gap),))
        for gap in (0.01, 0.004, 0.01)
    ]
    assert score_by_worst_engine(trials).shown == 1


def test_a_trial_that_fails_counts_nothing_and_is_reported():
    broken = earned(0.0, "other", status="failed", reason="it blew up")
    evaluation = evaluated(earned(1.0), earned(1.0), earned(1.0, "other"), broken)
    assert (evaluation.status, evaluation.reward) == ("ok", 0.5)
    assert evaluation.warnings == ("other, change 2 of 2: failed: it blew up",)
    everywhere = evaluated(earned(0.9), broken)
    assert (everywhere.status, everywhere.reward, everywhere.reason) == ("ok", 0.0, "")


def test_what_is_refused_everywhere_is_refused():
    refused = [
        earned(0.0, engine, status="rejected", reason="too long")
        for engine in ("one", "other")
    ]
    evaluation = evaluated(*refused)
    assert (evaluation.status, evaluation.reason, evaluation.reward) == (
        "rejected",
        "too long",
        0.0,
    )
    assert (evaluation.warnings, evaluation.rollouts) == ((), 0)


def test_the_worst_trial_is_the_one_that_is_shown():
    seen = Observation("missed")
    others = [
        earned(reward, "other", number) for number, reward in enumerate((0.9, 0.2, 0.5))
    ]
    others[1] = replace(others[1], observation=seen)
    found = evaluated(earned(1.0), *others)
    assert (found.shown.engine, found.shown.where.change) == ("other", 1)
    assert found.observation is seen
    assert found.by_engine["other"] == (0.9, 0.2, 0.5)


# --- real engines -----------------------------------------------------------------------------------------------


def test_a_tool_that_starts_in_a_body_that_was_moved_is_refused_there():
    """One that ends a millimetre from the cube's near face: some changes bring the cube nearer."""
    home = TASK.shared().home
    reach, down, thick = (
        1.0 - 0.035 - 0.001 - home.position[0],
        home.position[2] - 0.035,
        0.01,
    )
    post = Component(
        "post", "tool_mount", Pose.xyz_rpy((0, 0, -down / 2)), Box((thick, thick, down))
    )
    bar = Component(
        "bar",
        "post",
        Pose.xyz_rpy((reach / 2, 0, -down / 2)),
        Box((reach, thick, thick)),
    )
    tool = Tool((post, bar))
    SpawnRules(TASK.shared(), 0).check(tool)  # clear of the scene as it is
    still = Candidate(tool, Waypoints(np.array([[*home.position, *home.rpy]])))
    ranges = PerturbationRange(position=0.005, yaw=0.0)
    conditions = [
        replace(CONDITION, change=Perturbation(ranges, draw)) for draw in range(8)
    ]
    tried = [play(condition, [still])[0] for condition in conditions]
    refused = {draw for draw, trial in enumerate(tried) if trial.status == "rejected"}
    cubes = [condition.scene()["cube"].pose.position for condition in conditions]
    near = {draw for draw, (x, _, _) in enumerate(cubes) if x < 1.0 - 0.001}
    assert refused == near
    assert 0 < len(refused) < 8
    assert all(
        tried[draw].reason.startswith("in the perturbed scene, component 'bar' starts")
        for draw in near
    )


# --- tools ------------------------------------------------------------------------------------------------------


def test_a_tool_grows_or_shrinks_about_its_mount_and_is_rougher_or_smoother():
    surface = Mesh.from_trimesh(Box((0.1, 0.1, 0.1)).to_trimesh())
    shapes = (
        Box((0.02, 0.03, 0.2)),
        Capsule(0.01, 0.1),
        surface,
        Compound(surface, (surface,)),
    )
    components = [
        Component(f"part{n}", "tool_mount", Pose.xyz_rpy((0, 0, -0.1 * n)), shape)
        for n, shape in enumerate(shapes)
    ]
    tool = Tool(tuple(components))
    ranges = PerturbationRange(size=0.1)
    for number in range(5):
        changed = Perturbation(ranges, number).perturb_tool(tool)
        scale = changed.components[0].shape.size[2] / 0.2
        assert 0.9 <= scale <= 1.1
        assert scale != 1
        assert 0.8 <= changed.friction / tool.friction <= 1.2
        for before, after in zip(tool.components, changed.components, strict=True):
            assert after.shape.volume == pytest.approx(before.shape.volume * scale**3)
            assert np.allclose(after.pose.position, scale * before.pose.position)
        assert changed == Perturbation(ranges, number).perturb_tool(tool)
    assert Perturbation(PerturbationRange(), 3).perturb_tool(tool) is tool


def test_a_perturbed_tool_is_played_in_its_condition_alone():
    change = Perturbation(PerturbationRange(size=0.5), 1)
    rod = Component("rod", "tool_mount", Pose(), Box((0.02, 0.02, 0.1)))
    candidate = Candidate(Tool((rod,)), np.zeros((1, 6)))
    perturbed = replace(CONDITION, change=change).perturb(candidate)
    assert perturbed.tool != candidate.tool
    assert CONDITION.perturb(candidate).tool is candidate.tool
