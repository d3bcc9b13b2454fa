"""What a configuration may say, and Hydra's complaints turned into one line."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any, TypeVar

from hydra import compose, initialize_config_module
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, MissingConfigException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import ConfigAttributeError, ConfigKeyError, OmegaConfBaseException

from core.config import sources
from core.config.schemas import (
    ComposeConfig,
    ConformanceConfig,
    EvaluateConfig,
    GalleryConfig,
    RenderConfig,
    ReportConfig,
    RunConfig,
    TransferConfig,
)
from core.errors import UsageError, UserError, choices
from core.plugins import NOT_SETTINGS, Part

T = TypeVar("T")


def register() -> None:
    """Make the schemas known to Hydra, from which the primary configs in ``conf/`` start, and what plugins bring."""
    sources.register()
    store = ConfigStore.instance()
    store.store("run_schema", RunConfig)
    store.store("evaluate_schema", EvaluateConfig)
    store.store("render_schema", RenderConfig)
    store.store("prompt_schema", ComposeConfig)
    store.store("transfer_schema", TransferConfig)
    store.store("conformance_schema", ConformanceConfig)
    store.store("report_schema", ReportConfig)
    store.store("gallery_schema", GalleryConfig)


def renamed(overrides: Sequence[str]) -> list[str]:
    """The overrides with the old name ``logger`` replaced by ``listener``; standard error says so."""
    new = [re.sub(r"^([+~]*)logger(?=[=.@]|$)", r"\1listener", word) for word in overrides]
    if new != list(overrides):
        sys.stderr.write("warning: the config group 'logger' is called 'listener' now; write listener=\n")
    return new


def load(name: str, overrides: Sequence[str]) -> DictConfig:
    """The primary config ``name`` with command-line overrides.

    Raises:
        UserError: a wrong group, key or type; it says what is possible.
    """
    register()
    overrides = renamed(overrides)
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


def part(kind: str, config: DictConfig) -> Part:
    """The part that a config node names, with its settings.

    Raises:
        UserError: the node names none.
    """
    settings = OmegaConf.to_container(config, resolve=True)
    if not isinstance(settings, dict) or not isinstance(settings.get("name"), str):
        raise UserError(f"{kind}: the configuration names no part; give it a 'name'")
    kept = {str(k): _hashable(v) for k, v in settings.items() if k not in ("name", *NOT_SETTINGS.get(kind, ()))}
    return Part(kind, settings["name"], tuple(kept.items()))


def _hashable(value: Any) -> Any:
    return tuple(_hashable(item) for item in value) if isinstance(value, list) else value
