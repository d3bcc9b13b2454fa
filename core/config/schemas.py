"""Define the configurations as typed schemas, one for each command."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from omegaconf import MISSING

from core.config.settings import PromptSettings, Sampling
from core.interfaces import RolloutSettings
from core.values.materials import Material


@dataclass
class BudgetConfig:
    """How many designs a run tries; ``stop_reward``: stop when the best reward reaches it (null: never)."""

    n_agent: int = MISSING
    n_tool: int = MISSING
    n_action: int = MISSING
    k_top: int = MISSING
    reward_save: float = MISSING
    n_iteration: int = MISSING
    name: str = MISSING
    stop_reward: float | None = None


@dataclass
class PromptConfig(PromptSettings):
    """The prompt's settings, under a name."""

    name: str = MISSING


@dataclass
class SceneConfig:
    """The task, the robot, the engine, the tools' material, the layout's seed.

    A part's settings are checked by its factory's signature.
    """

    task: dict[str, Any] = MISSING
    robot: dict[str, Any] = field(default_factory=dict)  # empty: the default robot, as in runs of earlier versions
    sim: dict[str, Any] = MISSING
    material: Material = field(default_factory=Material)
    seed: int = 0


@dataclass
class ProtocolConfig:
    """What all entries of a benchmark have in common.

    ``fixed``: the settings that an entry may not change. ``tracks``: the plugin that offers the tasks of each.
    ``engines`` and ``layouts``: how many unseen layouts the best candidate is tried in, in each engine.
    """

    name: str = "none"
    version: int = 0
    fixed: list[str] = field(default_factory=list)
    tracks: dict[str, str] = field(default_factory=dict)
    engines: list[str] = field(default_factory=list)
    layouts: int = 0


@dataclass
class TrialConfig(SceneConfig):
    """How candidates are read, tried and judged."""

    tool: dict[str, Any] = MISSING
    action: dict[str, Any] = field(default_factory=lambda: {"name": "waypoints"})
    fitness: dict[str, Any] = field(default_factory=lambda: {"name": "nominal"})
    executor: dict[str, Any] = MISSING
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    protocol: ProtocolConfig = field(default_factory=ProtocolConfig)


@dataclass
class SearchConfig(TrialConfig):
    """How candidates are asked for."""

    vlm: dict[str, Any] = MISSING
    evolution: dict[str, Any] = MISSING
    prompt: PromptConfig = field(default_factory=PromptConfig)
    budget: BudgetConfig = field(default_factory=BudgetConfig)
    sampling: Sampling = field(default_factory=Sampling)


@dataclass
class RunConfig(SearchConfig):
    """Settings of ``python -m core.run``. ``name``: what reports call the method; empty: what distinguishes it."""

    name: str = ""
    listener: dict[str, Any] = field(default_factory=dict)
    film: bool = True


@dataclass
class EvaluateConfig(TrialConfig):
    """Settings of ``python -m core.evaluate``. ``output``: a JSON file to write as well."""

    designs: str = MISSING
    output: str | None = None


@dataclass
class ComposeConfig(SearchConfig):
    """Settings of ``python -m core.prompt``.

    ``designs``: the file of the elites; ``agent``: the number of the agent that sends the request; ``output``: the
    folder to write.
    """

    designs: str | None = None
    agent: int = 0
    output: str = "prompt"
