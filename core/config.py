"""What a configuration may say, and Hydra's complaints turned into one line."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from typing import Any, TypeVar

from hydra import compose, initialize_config_module
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, MissingConfigException
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from core import hydra_sources
from core.errors import UsageError, UserError, choices
from core.interfaces import RolloutSettings
from core.plugins import Part
from core.settings import PromptSettings, Sampling, Spread

T = TypeVar("T")


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
class BenchConfig:
    """Where candidates are tried. The settings of each part are checked by what the part's plugin registered."""

    task: dict[str, Any] = MISSING
    sim: dict[str, Any] = MISSING
    seed: int = 0


@dataclass
class RunConfig(BenchConfig):
    """What ``python -m core.run`` may be told."""

    vlm: dict[str, Any] = MISSING
    tool: dict[str, Any] = MISSING
    evolution: dict[str, Any] = MISSING
    fitness: dict[str, Any] = field(default_factory=lambda: {"name": "nominal"})
    executor: dict[str, Any] = MISSING
    logger: dict[str, Any] = field(default_factory=dict)
    prompt: PromptConfig = field(default_factory=PromptConfig)
    budget: BudgetConfig = field(default_factory=BudgetConfig)
    sampling: Sampling = field(default_factory=Sampling)
    rollout: RolloutSettings = field(default_factory=RolloutSettings)
    film: bool = True


@dataclass
class EvaluateConfig(BenchConfig):
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
    spread: Spread = field(default_factory=Spread)
    designs: str = MISSING
    top: int = 1
    output: str | None = None


@dataclass
class RenderConfig(BenchConfig):
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
    executor: dict[str, Any] | None = None


@dataclass
class ComposeConfig(BenchConfig):
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


def register() -> None:
    """Make the schemas known to Hydra, from which the primary configs in ``conf/`` start, and what plugins bring."""
    hydra_sources.register()
    store = ConfigStore.instance()
    store.store("run_schema", RunConfig)
    store.store("evaluate_schema", EvaluateConfig)
    store.store("render_schema", RenderConfig)
    store.store("prompt_schema", ComposeConfig)
    store.store("transfer_schema", TransferConfig)
    store.store("conformance_schema", ConformanceConfig)
    store.store("report_schema", ReportConfig)
    store.store("gallery_schema", GalleryConfig)


def load(name: str, overrides: Sequence[str]) -> DictConfig:
    """The primary config ``name`` with command-line overrides.

    Raises:
        UserError: a wrong group, key or type; it says what is possible.
    """
    register()
    try:
        return _compose(name, overrides)
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error, name, overrides) from error


def overview(name: str, overrides: Sequence[str]) -> str:
    """For people: the groups with what they offer, and the primary config ``name`` with command-line overrides.

    Raises:
        UserError: see `load`.
    """
    config = load(name, overrides)
    with initialize_config_module("conf", version_base="1.3"):
        loader = GlobalHydra.instance().config_loader()
        offered = {group: loader.get_group_options(group) for group in loader.list_groups("") if group != "hydra"}
    groups = "".join(f"{group}: {', '.join(sorted(names))}\n" for group, names in sorted(offered.items()))
    return f"groups (GROUP=NAME):\n\n{groups}\nkeys (KEY=VALUE), and what they are:\n\n{OmegaConf.to_yaml(config)}"


def _compose(name: str, overrides: Sequence[str]) -> DictConfig:
    within = GlobalHydra.instance().is_initialized()  # a job of Hydra's
    with nullcontext() if within else initialize_config_module("conf", version_base="1.3"):
        config: DictConfig = compose(name, list(overrides))
    return config


def explain(error: Exception, name: str, overrides: Sequence[str]) -> UserError:
    """Hydra's complaint about ``overrides`` as one line that says what is possible."""
    if isinstance(error, MissingConfigException) and error.missing_cfg_file and error.options:
        group, _, choice = error.missing_cfg_file.rpartition("/")
        return choices(group, choice, error.options)
    found = re.search(r"Could not override '([^']+)'", str(error))
    cause = error.__cause__
    if found and isinstance(cause, ConfigAttributeError | ConfigKeyError):
        key = found.group(1).lstrip("+~")
        parent, _, wrong = key.rpartition(".")
        others = [o for o in overrides if o.lstrip("+~").partition("=")[0] != key]
        try:
            node = OmegaConf.select(_compose(name, others), parent) if parent else _compose(name, others)
        except (HydraException, OmegaConfBaseException):
            node = None  # something else is wrong as well; the plain message must do
        if isinstance(node, DictConfig):
            return choices("key", wrong, [str(k) for k in node], parent or "the configuration")
    message = " ".join(str(error).split())
    if isinstance(cause, OmegaConfBaseException):
        message = f"{message}: {first_line(cause)}"
    return UsageError(message)


def first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0]


def check_seed(seed: int) -> None:
    """Refuse a negative seed, which no generator takes.

    Raises:
        UsageError: says so.
    """
    if seed < 0:
        raise UsageError(f"seed must be 0 or greater, got {seed}")


def node(config: DictConfig, of: type[T]) -> T:
    """A typed node of a configuration as the dataclass that it is an instance of."""
    made = OmegaConf.to_object(config)
    assert isinstance(made, of)
    return made


def part(kind: str, config: DictConfig, without: Sequence[str] = ()) -> Part:
    """The part that a config node names, with its settings but for the keys in ``without``.

    Raises:
        UserError: the node names none.
    """
    settings = OmegaConf.to_container(config, resolve=True)
    if not isinstance(settings, dict) or not isinstance(settings.get("name"), str):
        raise UserError(f"{kind}: the configuration names no part; give it a 'name'")
    kept = {str(k): _hashable(v) for k, v in settings.items() if k not in ("name", *without)}
    return Part(kind, settings["name"], tuple(kept.items()))


def _hashable(value: Any) -> Any:
    return tuple(_hashable(item) for item in value) if isinstance(value, list) else value
