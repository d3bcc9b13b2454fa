"""Take over the settings of a run, where a command is given the run's folder in the place of a designs file."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from core.config.compose import first_line
from core.config.gate import take_stored
from core.errors import UserError
from core.store.reader import StoredRun
from core.support.cli import key_of, read_path

SECTIONS = ("rollout", "material", "printer")  # settings that are taken over key by key
KINDS = ("task", "tool", "robot")


def take_run(
    words: Sequence[str], kinds: Sequence[str] = KINDS
) -> tuple[dict[str, Any] | None, list[str]]:
    """Return the configuration of the run that words name as ``designs``, and the words that it does not hold.

    Args:
        words: of the command line.
        kinds: the parts that are used.

    Raises:
        UserError: it has to be typed again (`core.config.gate`), or can't be read.
    """
    for word in words:
        key, _, value = word.partition("=")
        folder = read_path(value)
        if key == "designs" and folder.is_dir():
            chosen = set(map(key_of, words))
            used = [kind for kind in kinds if kind not in chosen]
            return take_stored(stored_config(folder), folder, words, used)

    return None, list(words)


def take_over(
    cfg: DictConfig,
    run: Mapping[str, Any],
    named: Collection[str],
    kinds: Sequence[str] = KINDS,
) -> None:
    """Take over settings of a run into ``cfg``, but those that are ``named``, and what stands below such a one.

    Args:
        cfg: of the command; its ``designs`` are the run's.
        run: its configuration.
        named: the keys of the command line.
        kinds: the parts that are used.

    Raises:
        UserError: the run's configuration can't be used here.
    """
    if "seed" not in named:
        cfg.seed = run["seed"]

    groups = {name.partition(".")[0] for name in named}
    try:
        for section in SECTIONS:
            for key, value in run.get(section, {}).items():
                if not {section, f"{section}.{key}"} & {*named}:
                    OmegaConf.update(cfg, f"{section}.{key}", value)

        for kind in kinds:
            if kind not in groups:
                OmegaConf.update(cfg, kind, run[kind], merge=False, force_add=True)
    except (KeyError, OmegaConfBaseException) as error:
        raise UserError(
            f"{cfg.designs}: its configuration can't be used here: {first_line(error)}"
        ) from error


def stored_config(folder: Path) -> dict[str, Any]:
    """Return the configuration of a run.

    Raises:
        UserError: the folder holds no run, or one that this version can't read.
    """
    config = StoredRun(folder).config()
    if not config:
        raise UserError(
            f"{folder} holds a run that ended before it began; its store is empty"
        )

    return config
