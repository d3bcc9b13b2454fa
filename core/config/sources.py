"""Give Hydra the configs of parts: from ``conf/``, packages of plugins, and factories' signatures."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

from hydra._internal.core_plugins.importlib_resources_config_source import (
    ImportlibResourcesConfigSource,
)
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins as HydraPlugins
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import MISSING, OmegaConf

from core.config.folders import new_folder, notes_folder, task_folder
from core.errors import UserError
from core.plugins import KINDS, installed
from core.plugins.registry import settings_of

_stand_ins: dict[tuple[str, str], str] = {}
"""Why a part was chosen in place of the usual one, by its kind and name."""


class PluginConfigs(SearchPathPlugin):  # type: ignore[misc]  # hydra has no types
    """Search for the config of a part first; for other configs in ``conf/``, then in the packages that plugins name."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        search_path.prepend("parts", f"{PartConfigs.scheme()}://")

        for path, distribution in installed().configs.items():
            search_path.append(distribution, path)


class PartConfigs(ConfigSource):  # type: ignore[misc]
    """The config of each part: the defaults of its factory's signature, under its YAML file, if there is one."""

    @staticmethod
    def scheme() -> str:
        return "parts"

    def available(self) -> bool:
        return True

    def is_group(self, config_path: str) -> bool:
        return config_path.strip("/") in ("", *KINDS)

    def is_config(self, config_path: str) -> bool:
        kind, name = _part(config_path)
        return kind in KINDS and is_known(kind, name)

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        group = config_path.strip("/")
        if results_filter not in (
            None,
            ObjectType.CONFIG if group else ObjectType.GROUP,
        ):
            return []

        # A command is chosen by the word before all others.
        groups = sorted(KINDS.keys() - {"command"})
        return installed().names(group) if group else groups

    def load_config(self, config_path: str) -> ConfigResult:
        kind, name = _part(config_path)
        is_listener = kind == "listener"
        named = {} if is_listener else {"name": name}
        node = OmegaConf.create({**named, **defaults(kind, name)})
        result = ConfigResult(
            self.provider, f"{self.scheme()}://", node, {"package": None}
        )

        file = _file(config_path)
        if file is not None:
            result = file.load_config(config_path)
            if "defaults" not in result.config:  # else the defaults of its base hold
                result.config = OmegaConf.merge(node, result.config)
        if is_listener:  # several at once, each under its name
            result.header["package"] = f"{kind}.{name}"

        return result


def is_known(kind: str, name: str) -> bool:
    """Report whether there is a part of this name, without importing it."""
    offered = (kind, name) in installed().offers
    return offered or _file(f"{kind}/{name}") is not None


def _part(config_path: str) -> tuple[str, str]:
    """Split the path of a config, such as ``sim/mujoco``, into the kind and the name of its part."""
    kind, _, name = config_path.strip("/").removesuffix(".yaml").partition("/")
    return kind, name


def _file(config_path: str) -> ConfigSource | None:
    """The package that holds the YAML file of a part, if one does."""
    for path in ("pkg://conf", *installed().configs):
        source = ImportlibResourcesConfigSource("parts", path)
        try:
            if source.is_config(config_path):
                return source
        except OSError:  # no file has so long a name
            return None

    return None


def defaults(kind: str, name: str) -> dict[str, Any]:
    """Return the settings of a part with their defaults, as far as YAML can express them.

    What the program itself reads of such a part is among them (`core.plugins.kinds.Kind.defaults`). A part that can't
    be imported has none here; the error is reported when the part is made.
    """
    try:
        factory = installed().factory(kind, name)
        possible = settings_of(factory, KINDS[kind].provided)
    except (UserError, TypeError, ValueError):
        return {}

    settings: dict[str, Any] = {}

    for setting, parameter in possible.items():
        needed = parameter.default is parameter.empty
        default = MISSING if needed else parameter.default
        with suppress(TypeError):  # YAML can't say it
            json.dumps(default)
            settings[setting] = default

    settings |= KINDS[kind].defaults
    declared = getattr(factory, "tool_kinds", ())  # by a task's class
    if declared and isinstance(declared, list | tuple):
        settings["tool_kinds"] = list(declared)

    return settings


def first_usable(kind: str, *names: str) -> str:
    """Return the first of several parts that can be imported here; the first of all where none can."""
    missing: list[UserError] = []
    for name in names:
        try:
            installed().factory(kind, name)
        except UserError as error:
            missing.append(error)
            continue

        if missing:
            _stand_ins[kind, name] = str(missing[0])
        return name

    return names[0]


def explain_stand_in(kind: str, name: str) -> str:
    """Say why a part was chosen in place of the usual one (`first_usable`); empty: it was not."""
    reason = _stand_ins.get((kind, name))
    return f"{kind}={name}, since {reason}" if reason else ""


def register() -> None:
    """Register the sources, and what configurations call, with Hydra; call it before composing."""
    for source in (PluginConfigs, PartConfigs):
        HydraPlugins.instance().register(source)
    # It makes one for a configuration, however often it is asked.
    OmegaConf.register_new_resolver(
        "new_folder", new_folder, replace=True, use_cache=True
    )
    OmegaConf.register_new_resolver("notes_folder", notes_folder, replace=True)
    OmegaConf.register_new_resolver("task_folder", task_folder, replace=True)
    OmegaConf.register_new_resolver("first_usable", first_usable, replace=True)
