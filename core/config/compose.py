"""Compose configurations with Hydra, and turn its complaints into one line."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from hydra import compose, initialize_config_module
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.object_type import ObjectType
from hydra.errors import (
    HydraException,
    MissingConfigException,
    OverrideParseException,
)
from hydra.plugins.config_source import ConfigSource
from omegaconf import MISSING, DictConfig, OmegaConf
from omegaconf.errors import (
    ConfigAttributeError,
    ConfigKeyError,
    MissingMandatoryValue,
    OmegaConfBaseException,
)

from core.config import schemas, sources
from core.config.trust import refuse_key_words, refuse_keys
from core.config.words import (
    explain_word,
    place_settings,
    quote_paths,
)
from core.errors import UsageError, UserError, choices
from core.interfaces import Simulator, Task, ToolRepresentation
from core.plugins import (
    KINDS,
    ROBOT,
    SIMULATOR,
    TASK,
    TOOL,
    Kind,
    PluginPart,
    installed,
)
from core.plugins.outside import list_readers
from core.support.cli import key_of, say
from core.trial import Part
from core.values.layouts import NONE
from core.values.materials import Material
from core.values.printers import Printer

T = TypeVar("T")

MOST_SEED = 2**53

SCHEMAS: dict[str, type] = {
    "run": schemas.RunConfig,
    "evaluate": schemas.EvaluateConfig,
}
"""The schemas of core's own commands, from which their primary configs start; a plugin's command gives its own."""


def register() -> None:
    """Register the schemas of core's commands, and the configs of plugins, with Hydra."""
    sources.register()
    for name, schema in SCHEMAS.items():
        _register_schema(name, schema)


@cache  # it would be a quarter of the time of composing
def _register_schema(name: str, schema: type) -> None:
    ConfigStore.instance().store(f"{name}_schema", schema)


def load(name: str, overrides: Sequence[str], schema: type | None = None) -> DictConfig:
    """Compose the primary config ``name`` with command-line overrides.

    Args:
        name: of a file in ``conf/``, or in a package that a plugin names (`core.hooks.Configs`).
        overrides: the words of the command line.
        schema: the dataclass of its keys, for a plugin's command; the file names it ``NAME_schema`` in its defaults.

    Raises:
        UserError: a wrong group, key or type; the message says what is possible.
    """
    refuse_key_words(overrides)
    refuse_unknown_parts(overrides)
    register()
    if schema is not None:
        _register_schema(name, schema)

    keys = schema or SCHEMAS.get(name, schemas.RunConfig)
    words = quote_paths(place_settings(overrides, keys))
    try:
        config = _compose(name, words)
        check_keys(config)
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error) from error

    return config


def list_groups() -> dict[str, list[str]]:
    """List the groups of a run's configuration, and the names that each can have."""
    register()
    with initialize_config_module("conf", version_base="1.3"):
        loader = GlobalHydra.instance().config_loader()
        sources = loader.get_sources()
        groups = [name for name in loader.list_groups("") if name != "hydra"]

    # Hydra's `get_group_options` would build its cache anew for each group.
    return {name: _list_options(sources, name) for name in groups}


def _list_options(sources: Sequence[ConfigSource], group: str) -> list[str]:
    """List the names that a group can have, whichever of the sources has them."""
    options: set[str] = set()
    for source in sources:
        if source.is_group(group):
            options.update(source.list(group, ObjectType.CONFIG))

    return sorted(options)


def check_keys(config: DictConfig) -> None:
    """Check that no secret stands in a composed configuration, and no key that a ``+`` added beside its schema.

    The settings of a part have no schema: its factory checks them.

    Raises:
        UserError: there is a secret.
        OmegaConfBaseException: there is such a key (`explain`).
    """
    refuse_keys(config)
    schema = OmegaConf.get_type(config)
    if is_dataclass(schema):
        OmegaConf.merge(schema, OmegaConf.to_container(config))


def refuse_unknown_parts(words: Sequence[str]) -> None:
    """Refuse the name of a part that there is not, before those that there are get imported, which takes a second.

    Whatever may mean more than a name is left to Hydra.

    Raises:
        UsageError: says which names are possible.
    """
    if any(word.startswith("-") for word in words):
        return  # it may say where more configs are

    for word in words:
        kind, _, name = word.partition("=")
        is_name = name.isidentifier() and name != "null"
        if kind in KINDS and is_name and not sources.is_known(kind, name):
            raise _refuse_choice(kind, name, list_groups()[kind])


def _refuse_choice(group: str, choice: str, options: Sequence[str]) -> UsageError:
    """Say that a group has no such choice, and which it has."""
    unknown = choices(group, choice, options)
    return UsageError(f"{unknown}{installed().failed}").coded(*unknown.refusals)


def _compose(name: str, overrides: Sequence[str]) -> DictConfig:
    start: AbstractContextManager[object] = nullcontext()
    if not GlobalHydra.instance().is_initialized():  # else this is one of its jobs
        start = initialize_config_module("conf", version_base="1.3")
    with start:
        config: DictConfig = compose(name, list(overrides))
    return config


def explain(error: Exception) -> UserError:
    """Turn a complaint of Hydra or OmegaConf into one line that says what is possible."""
    failed = installed().failed

    if isinstance(error, OverrideParseException):
        return explain_word(error.override)

    if isinstance(error, MissingConfigException) and error.options:
        missing = error.missing_cfg_file or ""
        kind, _, path = missing.partition("/")
        # Only for what looks like a file: who reads what is known once all parts are imported.
        readers = list_readers(kind, path) if Path(path).suffix else []
        words = " or ".join(readers)
        if words:
            return UsageError(f"{kind}={path} is a file; to read it, type {words}")

        group, _, choice = missing.rpartition("/")
        return _refuse_choice(group, choice, error.options)

    if isinstance(error, MissingMandatoryValue):
        return UsageError(
            f"{error.full_key} has no value; give one with {error.full_key}=VALUE"
        )

    cause = error if isinstance(error, OmegaConfBaseException) else error.__cause__
    if isinstance(cause, ConfigAttributeError | ConfigKeyError):
        return _explain_key(cause)

    lacking = re.match(r"Could not override '([^']+)'", str(error))
    if lacking:
        return UsageError(
            f"this command has no group {lacking[1]!r}: leave {lacking[1]}=... out"
        )

    # Hydra advises to append a key, which `check_keys` refuses.
    message, _, _ = " ".join(str(error).split()).partition(" To append ")
    message = message.replace("--multirun", "-m")
    if isinstance(error.__cause__, OmegaConfBaseException):
        message = f"{message.rstrip('.')}: {first_line(error.__cause__)}"
    return UsageError(f"{message}{failed}")


def _explain_key(error: ConfigAttributeError | ConfigKeyError) -> UsageError:
    """Say what is possible where a key is unknown."""
    path, _, key = (error.full_key or "").rpartition(".")
    if path in KINDS and key in installed().names(path):
        return UsageError(
            f"{path}.{key} is a setting of {path}={key}; add {path}={key}"
        )

    known = [str(known) for known in error.parent_node or ()]
    return choices("key", key, known, path or "the configuration")


def first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0]


def check_seed(seed: int) -> None:
    """Raise a UsageError if the seed is negative, which no generator takes, or more than a store holds."""
    if not 0 <= seed <= MOST_SEED:
        raise UsageError(f"seed must be from 0 to {MOST_SEED}, got {seed}")


def node(config: DictConfig, kind: type[T]) -> T:
    """Convert a typed node of a configuration to its dataclass."""
    value = OmegaConf.to_object(config)
    assert isinstance(value, kind)
    return value


def part(kind: Kind[T], config: DictConfig) -> PluginPart[T]:
    """Return the part that a config node names, with its settings; of a robot, with its base.

    Raises:
        UserError: the node names no part, or refers to a key that this command lacks.
    """
    try:
        settings = OmegaConf.to_container(config, resolve=True)
    except (OmegaConfBaseException, ValueError) as error:  # the latter: there is none
        raise UserError(
            f"{kind}: its configuration can't be used here: {first_line(error)}"
        ) from error

    if not isinstance(settings, dict) or not isinstance(settings.get("name"), str):
        raise UserError(f"{kind}: the configuration names no part; give it a 'name'")

    group = KINDS[str(kind)]
    name = settings.pop("name")
    given = [
        (str(key), value)
        for key, value in settings.items()
        if key not in group.defaults and value != MISSING
    ]
    base = ()
    if group is ROBOT:
        base = settings.get("base") or ()
    return PluginPart(group.name, name, tuple(given), base=base)


def read_parts(
    kind: Kind[T],
    entries: Sequence[str | Mapping[str, Any]],
    chosen: Part[T] | None = None,
) -> dict[str, PluginPart[T]]:
    """Read a setting that lists parts of a kind, by the names under which they are shown.

    An entry is a name, or a mapping of a ``name`` and settings that differ from the configuration's. For the name of
    ``chosen`` these are its settings.

    Raises:
        UserError: an entry names no part; there are none, or one is repeated.
    """
    parts: dict[str, PluginPart[T]] = {}

    for entry in entries:
        given = {"name": entry} if isinstance(entry, str) else dict(entry)
        name = given.pop("name", None)
        if not isinstance(name, str):
            raise UsageError(
                f"{kind}: {entry!r} names no {kind}; give a name, or {{name: NAME, SETTING: VALUE}}"
            )

        shown = " ".join([name, *(f"{key}={value}" for key, value in given.items())])
        if shown in parts:
            raise UsageError(f"{kind}: {shown!r} is repeated; name each {kind} once")
        if chosen is not None and chosen.name == name:
            node: Any = {"name": name, **dict(chosen.settings)}
            if kind is ROBOT:
                node["base"] = getattr(chosen, "base", ())
        else:
            usual = load("config", [f"{kind}={name}"])[kind.name]
            node = OmegaConf.to_container(usual, resolve=True)

        parts[shown] = part(kind, OmegaConf.create({**node, **given}))

    if not parts:
        raise UsageError(f"{kind}: name at least one {kind}")
    return parts


def engines(
    sims: Sequence[str | Mapping[str, Any]], chosen: Part[Simulator] | None = None
) -> dict[str, PluginPart[Simulator]]:
    """Read a list of engines (`read_parts`), and make each once, so that a fault isn't reported by each worker.

    Raises:
        UserError: an engine does not exist or can't be used here; there are no entries, or one is repeated.
    """
    parts = read_parts(SIMULATOR, sims, chosen)
    for engine in parts.values():
        engine.create()
    return parts


def task_part(config: DictConfig) -> PluginPart[Task]:
    """Return the task of a command's configuration, for its robot."""
    return replace(part(TASK, config.task), robot=part(ROBOT, config.robot))


def add_search_words(config: DictConfig, words: Sequence[str]) -> DictConfig:
    """Compose a run's configuration with the words that its task is searched with (`Task.search_words`).

    Where ``words``, those of the command line, say something of these themselves, it stays as it is.

    Raises:
        UserError: the task can't be made, or asks for what is not there.
    """
    task = task_part(config).create()
    said = list(map(key_of, words))
    wanted = list(map(key_of, task.search_words))
    is_said = any(
        name == key or name.startswith(f"{key}.") for name in said for key in wanted
    )
    if not wanted or is_said or task.variation != NONE:
        return config

    added = " ".join(task.search_words)
    say(
        f"{task.name} is searched with {added}, for a tool that holds on the bench as it may be; for the scene as it "
        "is written add task.variation=none",
        file=sys.stderr,
    )
    return load("config", [*words, *task.search_words])


def task_parts(config: DictConfig) -> list[PluginPart[Task]]:
    """Return the tasks in which a tool is tried: that of the configuration, or what makes its parts."""
    whole = task_part(config)
    sources = whole.create().sources

    return [replace(source, robot=whole.robot) for source in sources] or [whole]


def tool_part(config: DictConfig) -> PluginPart[ToolRepresentation]:
    """Return the tool representation of a configuration, for its robot, its material and its printer.

    Raises:
        UserError: see `part`; or the material or the printer can't be used.
    """
    material = _read_section(config, "material", Material)
    printer = _read_section(config, "printer", Printer)
    return replace(
        part(TOOL, config.tool),
        robot=part(ROBOT, config.robot),
        material=material,
        printer=printer,
    )


def _read_section(config: DictConfig, name: str, kind: type[T]) -> T:
    """Return a section of a configuration as what it describes; a configuration of some parts alone may lack it.

    Raises:
        UserError: it can't be used.
    """
    try:
        merged = OmegaConf.merge(OmegaConf.structured(kind), config.get(name, {}))
        return node(cast(DictConfig, merged), kind)
    except (OmegaConfBaseException, ValueError) as error:  # the latter: it has no keys
        raise UserError(f"{name}: {first_line(error)}") from error
