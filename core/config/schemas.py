"""Define what a configuration may say, as typed schemas: one for each command."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from omegaconf import MISSING

from core.config.settings import PerturbationRange, PromptSettings, Sampling
from core.interfaces import RolloutSettings


@dataclass
class PaperConfig:
    """The paper's parameters for a task."""

    n_agent: int = MISSING
    n_tool: int = MISSING
    n_action: int = MISSING
    k_top: int = MISSING
    reward_save: float = MISSING
    n_iteration: int = MISSING


@dataclass
class BudgetConfig(PaperConfig):
    """How much is tried in a run; ``stop_reward``: stop early when the best reward reaches it (null: never)."""

    name: str = MISSING
    stop_reward: float | None = None


@dataclass
class PromptConfig(PromptSettings):
    """What a model is told, under a name."""

    name: str = MISSING


@dataclass
class SceneConfig:
    """Where candidates are tried. The settings of each part are checked by what the part's plugin registered."""

    task: dict[str, Any] = MISSING
    sim: dict[str, Any] = MISSING
    seed: int = 0


@dataclass
class RunConfig(SceneConfig):
    """What ``python -m core.run`` may be told."""

    vlm: dict[str, Any] = MISSING
    tool: dict[str, Any] = MISSING
    evolution: dict[str, Any] = MISSING
    fitness: dict[str, Any] = field(default_factory=lambda: {"name": "nominal"})
    executor: dict[str, Any] = MISSING
    listener: dict[str, Any] = field(default_factory=dict)
    prompt: PromptConfig = field(default_factory=PromptConfig)
    budget: BudgetConfig = field(default_factory=BudgetConfig)
    sampling: Sampling = field(default_factory=Sampling)
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    film: bool = True


@dataclass
class EvaluateConfig(SceneConfig):
    """What ``python -m core.evaluate`` may be told. ``output``: a JSON file to write besides the table."""

    tool: dict[str, Any] = MISSING
    executor: dict[str, Any] = MISSING
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    designs: str = MISSING
    output: str | None = None


@dataclass
class TransferConfig:
    """What ``python -m core.transfer`` may be told. ``designs``: a designs file, or a run's folder, of which the
    ``top`` best are taken. ``seed`` is the layout's, ``seeds`` are those of its changes. ``output``: a JSON file to
    write besides the table.
    """

    task: dict[str, Any] = MISSING
    tool: dict[str, Any] = MISSING
    executor: dict[str, Any] = MISSING
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    sims: list[Any] = MISSING
    seed: int = 0
    seeds: list[int] = MISSING
    perturbation: PerturbationRange = field(default_factory=PerturbationRange)
    designs: str = MISSING
    top: int = 1
    output: str | None = None


@dataclass
class RenderConfig(SceneConfig):
    """What ``python -m core.render`` may be told. ``designs``: mount the tool of its first strategy."""

    tool: dict[str, Any] = MISSING
    designs: str | None = None
    strategy: int = 0
    output: str = "scene.png"
    width: int = 640
    height: int = 480


@dataclass
class ConformanceConfig:
    """What ``python -m core.conformance`` may be told: of each kind the part that is to be checked, if any."""

    task: dict[str, Any] | None = None
    sim: dict[str, Any] | None = None
    vlm: dict[str, Any] | None = None
    tool: dict[str, Any] | None = None
    evolution: dict[str, Any] | None = None
    fitness: dict[str, Any] | None = None
    executor: dict[str, Any] | None = None
    listener: dict[str, Any] | None = None


@dataclass
class ComposeConfig(SceneConfig):
    """What ``python -m core.prompt`` may be told. ``designs``: take the elites from this file; ``agent``: whose request
    of the generation; ``output``: the folder to write.
    """

    vlm: dict[str, Any] = MISSING
    tool: dict[str, Any] = MISSING
    executor: dict[str, Any] = MISSING
    prompt: PromptConfig = field(default_factory=PromptConfig)
    budget: BudgetConfig = field(default_factory=BudgetConfig)
    sampling: Sampling = field(default_factory=Sampling)
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    designs: str | None = None
    agent: int = 0
    output: str = "prompt"


@dataclass
class ReportConfig:
    """What ``python -m core.report`` may be told. ``formats``: of the figures' files; ``confidence``: of the bootstrap
    intervals, which are drawn from so many ``resamples``.
    """

    output: str = "report"
    formats: list[str] = field(default_factory=lambda: ["png", "svg"])
    confidence: float = 0.95
    resamples: int = 10_000


@dataclass
class GalleryConfig:
    """What ``python -m core.gallery`` may be told. ``top``: how many tools of each task; ``apart_mm``: by how much
    a part's corner must lie elsewhere to make a tool another one; ``plate_mm``: the printer's build volume (x, y, z);
    ``min_wall_mm``: the thinnest wall that it makes.
    """

    output: str = "gallery"
    top: int = 3
    apart_mm: float = 10.0
    plate_mm: list[float] = field(default_factory=lambda: [250.0, 210.0, 220.0])
    min_wall_mm: float = 0.8
