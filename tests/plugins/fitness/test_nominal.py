"""The reward of one rollout."""

from omegaconf import OmegaConf

from core.config.compose import load, part


def test_nominal_is_the_default_and_passes_on_what_the_evaluator_says():
    assert load("config", []).fitness == {"name": "nominal"}
    nominal = part("fitness", OmegaConf.create({"name": "nominal"})).create(
        evaluator=lambda candidates: [f"evaluation of {c}" for c in candidates]
    )
    assert nominal(["a", "b"]) == ["evaluation of a", "evaluation of b"]
