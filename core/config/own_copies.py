"""Keep copies of the files that a run's task, arm and tool are made of, and use them where the run is taken up again.

So a run is whole in its folder: it is exported, compared and resumed from any folder, whatever became of the files.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from core.config.compose import task_part, tool_part
from core.errors import UserError
from core.plugins import PluginPart
from core.plugins.outside import outside_part
from core.support.cli import expand
from core.support.files import read_text, write_whole, writing
from core.support.inputs import adapter
from core.support.secrets import scrub

FOLDER = "inputs"
INDEX = "inputs.json"
SECTIONS = ("task", "robot", "tool")
MAX_BYTES = 1_000_000  # of the index


def keep_inputs(folder: Path, cfg: DictConfig) -> None:
    """Copy the files of a run's parts to its folder; a part that reads none has no copies.

    Raises:
        UserError: they can't be written.
    """
    task = task_part(cfg)
    parts = (task, task.robot, tool_part(cfg))
    index: dict[str, str] = {}
    with writing(folder):
        for section, part in zip(SECTIONS, parts, strict=True):
            if part is not None and part.files:
                settings = OmegaConf.to_container(cfg[section])
                index |= _copy(part, section, settings, folder / FOLDER)

        if index:
            text = json.dumps(index, indent=2)
            write_whole(folder / FOLDER / INDEX, f"{text}\n".encode())


def _copy(
    part: PluginPart[Any], section: str, settings: Any, folder: Path
) -> dict[str, str]:
    """Copy the files of a part as they lie beside each other; return the copy of each setting that names one."""
    files = part.files
    # Files may find each other by the name of the folder that they all lie in.
    above = Path(os.path.commonpath([file.parent for file in files])).parent

    named = {}
    for found in outside_part(section, settings, section):
        if isinstance(found.value, str):
            named[found.path] = Path(os.path.normpath(expand(found.value).absolute()))

    for file in files:
        copy = folder / section / file.relative_to(above)
        copy.parent.mkdir(parents=True, exist_ok=True)
        if file in named.values():  # a person wrote it
            write_whole(copy, scrub(file.read_text("utf-8")).encode())
        else:
            shutil.copyfile(file, copy)

    return {
        path: str(Path(section) / file.relative_to(above))
        for path, file in named.items()
        if file in files
    }


def use_copies(
    config: dict[str, Any], folder: Path, typed: Collection[str]
) -> dict[str, Any]:
    """Return a run's configuration with its own copies in the place of the files that it names.

    Args:
        config: as it is stored.
        folder: of the run, or of something else, which has no copies.
        typed: the keys that the user has typed now; what they name counts.
    """
    copies = _read_index(folder)
    if not copies:
        return config

    using = OmegaConf.create(config)
    for section in SECTIONS:
        for found in outside_part(section, config.get(section), section):
            file = (folder / FOLDER / copies.get(found.path, "")).absolute()
            if file.is_file() and not {section, found.path} & set(typed):
                OmegaConf.update(using, found.path, str(file))

    container: Any = OmegaConf.to_container(using)
    return dict(container)


def _read_index(folder: Path) -> Mapping[str, str]:
    """Read which setting has which copy; nothing where there is no index that can be read."""
    inputs = folder / FOLDER
    try:
        text = read_text(inputs / INDEX, most=MAX_BYTES, within=folder)
        index = adapter(dict[str, str]).validate_json(text)
    except (UserError, ValueError):
        return {}

    return {
        path: copy
        for path, copy in index.items()
        if (inputs / copy).resolve().is_relative_to(inputs.resolve())
    }
