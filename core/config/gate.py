"""Take from a stored configuration what is harmless, and the rest only where the user has typed it, here or before.

A run's folder, or a tool's in a library, may come from anybody. Its configuration names parts and their settings. A
number does no harm. A text may be a program, the variables that it is given, an address, a file or a folder: it is
taken where its type says that it is none of these (`core.values.harmless`), where it is the part's default, or where
this user has typed it.
"""

from __future__ import annotations

import shlex
import typing
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from core.config.compose import explain
from core.config.own_copies import use_copies
from core.config.remembered import is_remembered, remember
from core.config.schemas import RunConfig
from core.config.trust import refuse_key_words
from core.config.words import quote_paths
from core.errors import UserError
from core.plugins import KINDS
from core.plugins.outside import Found, describe, is_outside, outside_part
from core.support.cli import key_of
from core.support.text import clean, hydra_word

Config = Mapping[str, Any]

_LONGEST = 300  # characters of a place that is shown


def note_typed(config: Config) -> None:
    """Note that this user has typed a configuration, so that it may be used where it is stored."""
    if find_strange(config):
        remember(config)


def take_stored(
    config: Config,
    where: Path,
    words: Sequence[str] | None = None,
    kinds: Collection[str] | None = None,
) -> tuple[dict[str, Any], list[str]]:
    """Return a stored configuration as it may be used, and the words of the command line that are left.

    A word that types again what has to be is in the configuration then, and not left. The files that a run was begun
    with are its own copies, if it has some (`core.config.own_copies`).

    Args:
        config: of a run's folder or a library, see `core.config.trust.as_stored`.
        where: it was found; begins the error.
        words: of the command line; None: it takes none for this, and ``vlmgineer inspect`` does.
        kinds: the sections that are used, such as ``task``; None: all.

    Raises:
        UserError: something has to be typed again; says what to type.
    """
    refuse_key_words(words or ())
    outside = find_strange(config, kinds)
    given = set(map(key_of, words or ()))
    lacking = [
        f"{path}={hydra_word(value)}"
        for path, value, _ in outside
        if not any(f"{path}.".startswith(f"{key}.") for key in given)
    ]
    if lacking:
        place = clean(str(where), _LONGEST)
        mend = shlex.join(lacking)
        if words is None:
            mend = f"vlmgineer inspect {shlex.quote(place)} {mend}"
        raise UserError(
            f"{place} was not begun by you on this machine, and what it was begun with may be a program, a file or an "
            f"address: if you trust that, type it again: {mend}"
        )

    paths = {path for path, *_ in outside}
    typed = OmegaConf.create(dict(config))
    again = [word for word in words or () if key_of(word) in paths]
    try:
        for override in OverridesParser.create().parse_overrides(quote_paths(again)):
            key = override.key_or_group
            OmegaConf.update(typed, key, override.value(), merge=False)
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error) from error

    used = cast(dict[str, Any], OmegaConf.to_container(typed))
    left = [word for word in words or () if word not in again]
    return use_copies(used, where, given), left


def find_strange(config: Config, kinds: Collection[str] | None = None) -> list[Found]:
    """Return the settings that have to be typed again; none: this user has typed all of it.

    Args:
        config: as it is stored.
        kinds: the sections that are used; None: all.
    """
    if is_remembered(config):
        return []
    used = {key: config[key] for key in config if kinds is None or key in kinds}
    return list(find_outside(used))


def choose_again(config: Config, words: Sequence[str]) -> list[str]:
    """Return those of the words with which a run would begin that have to be typed again to go on with it."""
    strange = {found.path for found in find_strange(config)}
    return [word for word in words if key_of(word) in strange]


def find_outside(config: Config) -> Iterator[Found]:
    """Yield the settings of a configuration that may name something outside of the program."""
    sections = typing.get_type_hints(RunConfig, include_extras=True)
    for key, value in config.items():
        if key == "listener" and isinstance(value, Mapping):
            for name, settings in value.items():
                named = {"name": name, **(settings or {})}
                yield from outside_part(key, named, f"{key}.{name}")
        elif key in KINDS:
            yield from outside_part(key, value, key)
        else:
            yield from _outside_section(key, value, sections.get(key, Any))


def _outside_section(section: str, value: object, kind: Any) -> Iterator[Found]:
    """Yield what is outside in a section that is no part, such as ``prompt.file``."""
    if not isinstance(value, Mapping) or not isinstance(kind, type):
        if is_outside(value, kind):
            yield Found(section, value)
        return

    hints = typing.get_type_hints(kind, include_extras=True)
    for name, entry in value.items():
        hint = hints.get(name, Any)
        if is_outside(entry, hint):
            yield Found(f"{section}.{name}", entry, describe(hint))
