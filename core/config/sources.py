"""Give Hydra the configs of parts (from ``conf/``, packages of plugins, factories' signatures), and a run's folder."""

from __future__ import annotations

import inspect
import itertools
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any, cast

from hydra._internal.core_plugins.importlib_resources_config_source import (
    ImportlibResourcesConfigSource,
)
from hydra.core.config_search_path import ConfigSearchPath
from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins as HydraPlugins
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import MISSING, DictConfig, OmegaConf

from core.errors import UserError
from core.plugins import KINDS, installed


class PluginConfigs(SearchPathPlugin):  # type: ignore[misc]  # hydra has no types
    """Search for the config of a part first; for other configs in ``conf/``, then in the packages that plugins name."""

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        search_path.prepend("parts", f"{PartConfigs.scheme()}://")
        for distribution, paths in installed().configs.items():
            for path in paths:
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
        kind, _ = part = _part(config_path)
        return kind in KINDS and (
            part in installed().offers or _file(config_path) is not None
        )

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        group = config_path.strip("/")
        if group == "":
            return sorted(KINDS) if results_filter in (None, ObjectType.GROUP) else []
        return (
            installed().names(group)
            if results_filter in (None, ObjectType.CONFIG)
            else []
        )

    def load_config(self, config_path: str) -> ConfigResult:
        kind, name = _part(config_path)
        base = OmegaConf.create({"name": name, **defaults(kind, name)})
        file = _file(config_path)
        if file is None:
            return ConfigResult(
                self.provider,
                f"{self.scheme()}://",
                _placed(kind, name, base),
                {"package": None},
            )

        result = file.load_config(config_path)
        if "defaults" not in result.config:  # else the defaults of its base hold
            own = result.config[name] if kind == "listener" else result.config
            result.config = _placed(
                kind, name, cast(DictConfig, OmegaConf.merge(base, own))
            )
        return result


def _placed(kind: str, name: str, node: DictConfig) -> DictConfig:
    """Put a part's settings where its group has them: there are several listeners at once, each under its name."""
    if kind != "listener":
        return node
    settings = {
        key: value for key, value in node.items_ex(resolve=False) if key != "name"
    }
    return OmegaConf.create({name: settings})


def _part(config_path: str) -> tuple[str, str]:
    kind, _, name = config_path.strip("/").removesuffix(".yaml").partition("/")
    return kind, name


def _file(config_path: str) -> ConfigSource | None:
    """The package that holds the YAML file of a part, if one does."""
    for path in (
        "pkg://conf",
        *(path for paths in installed().configs.values() for path in paths),
    ):
        source = ImportlibResourcesConfigSource("parts", path)
        if source.is_config(config_path):
            return source
    return None


def defaults(kind: str, name: str) -> dict[str, Any]:
    """The settings of a part with their defaults, as far as YAML can express them.

    A part that can't be imported has none here; the error is reported when the part is made.
    """
    try:
        factory = installed().factory(kind, name)
        parameters = inspect.signature(factory).parameters.values()
    except (UserError, TypeError, ValueError):
        return {}
    settings = {
        parameter.name: MISSING
        if parameter.default is parameter.empty
        else parameter.default
        for parameter in parameters
        if parameter.kind in (parameter.POSITIONAL_OR_KEYWORD, parameter.KEYWORD_ONLY)
    }
    plain = {
        key: value
        for key, value in settings.items()
        if _is_plain(value) and key not in KINDS[kind].provided
    }
    return plain | {
        key: _own_default(factory, key, value)
        for key, value in KINDS[kind].defaults.items()
    }


def _own_default(factory: object, key: str, default: Any) -> Any:
    """Return the default of a key that the program reads: what a part's class has under that name, else the kind's."""
    own = getattr(factory, key, ())
    return list(own) if isinstance(own, list | tuple) and own else default


def _is_plain(value: object) -> bool:
    if isinstance(value, list | tuple):
        return all(map(_is_plain, value))
    if isinstance(value, dict):
        return all(
            isinstance(key, str) and _is_plain(item) for key, item in value.items()
        )
    return value is None or isinstance(value, bool | int | float | str)


def register() -> None:
    """Register the sources with Hydra; call it before composing."""
    for source in (PluginConfigs, PartConfigs):
        HydraPlugins.instance().register(source)


def new_folder(name: str) -> str:
    """Make the folder, or where there is one of its name ``NAME_2``, ``NAME_3`` and so on; return its name.

    Where none can be made, the name is returned: what writes to it gives the reason.
    """
    for number in itertools.count(1):
        chosen = name if number == 1 else f"{name}_{number}"
        try:
            Path(chosen).mkdir(parents=True)
        except FileExistsError:
            continue
        except OSError:
            break
        return chosen
    return name


def stamp() -> str:
    """Return the local time as it stands in the names of folders."""
    return datetime.now().strftime("%Y-%m-%d_%H-%M-%S")


@cache
def run_folder(name: str) -> str:
    """Make the folder of this process's run, once: Hydra asks for it many times."""
    return new_folder(name)


def task_folder(task: DictConfig) -> str:
    """Name a task in the names of folders: one that stands in a file by the file's name."""
    file = task.get("file")
    return (Path(file).stem.strip(".") if isinstance(file, str) else "") or str(
        task.name
    )


OmegaConf.register_new_resolver("new_folder", run_folder, replace=True)
OmegaConf.register_new_resolver("task_folder", task_folder, replace=True)
