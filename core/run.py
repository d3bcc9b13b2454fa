"""``python -m core.run``: start a run, or go on with one (`core.search.orchestration`).

Libraries for runs are imported inside functions: worker processes import this file as well, and ``--help`` is quick.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from core.errors import UsageError, UserError
from core.support.cli import command, read_path, say

if TYPE_CHECKING:
    from omegaconf import DictConfig

_SWEEP = {"-m", "--multirun"}
_FOLDER = "hydra.sweep.dir="  # of a sweep
# The best reward is what it looks for, and a run that fails does not end it.
_OPTUNA = {
    "hydra.sweeper.direction": "maximize",
    "hydra.sweeper.max_failure_rate": "1.0",
}
HELP_WORDS = {"--help", "-h"}
HELP = """\
usage: python -m core.run [GROUP=NAME | KEY=VALUE ...]      start a run; groups and keys are listed below
       python -m core.run -m KEY=VALUE,VALUE ...            a run for each combination
       python -m core.run resume=RUN_DIR [KEY=VALUE ...]    go on with an interrupted run
       python -m core.run --hydra-help                      Hydra's own flags

groups (GROUP=NAME):

{groups}

keys (KEY=VALUE), and their values:
"""


def _run_job(cfg: DictConfig) -> float:
    """Run one job of Hydra's, and return its best reward.

    Raises:
        UserError: it failed.
        BrokenPipeError: who reads what is printed is gone.
    """
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf.errors import OmegaConfBaseException

    from core.config.compose import add_search_words, check_keys, explain
    from core.search.orchestration import run_and_print, run_job

    hydra = HydraConfig.get()
    folder = Path(hydra.runtime.output_dir)
    start = run_job if hydra.mode is RunMode.MULTIRUN else run_and_print
    try:
        check_keys(cfg)
        return start(add_search_words(cfg, list(hydra.overrides.task)), folder)
    except OmegaConfBaseException as error:  # an unknown key, or one without a value
        raise explain(error) from error


def main(words: list[str]) -> None:
    """Go on with the run that ``resume=RUN_DIR`` names; else hand all words to Hydra, ``--help`` too."""
    if not HELP_WORDS.isdisjoint(words):
        _print_help([word for word in words if word not in HELP_WORDS])
        return

    resumed = [word for word in words if word.startswith("resume=")]
    if not resumed:
        _hydra(words)
        return

    others = [word for word in words if word not in resumed]
    flags = [word for word in others if word.startswith("-")]
    if len(resumed) > 1 or flags:
        raise UsageError(
            f"{' '.join([*flags, *resumed])}: resume=RUN_DIR goes on with one run, such as a sweep's"
        )

    from core.search.orchestration import resume

    resume(read_path(resumed[0].removeprefix("resume=")), others)


def _print_help(words: list[str]) -> None:
    """Print how the command is used, and the keys and values that words lead to; Hydra's own help takes seconds.

    The keys come last: for these all parts are imported, which takes most of the time.
    """
    from omegaconf import OmegaConf

    from core.config.compose import list_groups, load, refuse_unknown_parts

    refuse_unknown_parts(words)
    groups = [f"{name}: {', '.join(parts)}" for name, parts in list_groups().items()]
    say(*HELP.format(groups="\n".join(groups)).splitlines(), "")
    sys.stdout.flush()

    keys = OmegaConf.to_yaml(load("config", words))
    say(*keys.splitlines())


def _hydra(given: list[str]) -> None:
    import hydra
    from hydra.errors import HydraException
    from omegaconf.errors import OmegaConfBaseException

    from core.config.compose import explain, refuse_unknown_parts, register
    from core.config.schemas import RunConfig
    from core.config.trust import KeyFound, refuse_key_words
    from core.config.words import place_settings, quote_paths

    refuse_key_words(given)
    refuse_unknown_parts(given)
    register()
    words = quote_paths(place_settings(given, RunConfig))
    words.sort(key=lambda word: word not in _SWEEP)  # Hydra takes no word before it
    _add_sweep_words(words)
    failures: list[UserError | BrokenPipeError] = []
    here = os.getpid()

    def job(cfg: DictConfig) -> float | None:
        """Return the best reward, which a sweeper may optimise; None of a job that failed.

        What is raised would be printed by Hydra, with lines of its own.
        """
        try:
            return _run_job(cfg)
        except (UserError, BrokenPipeError) as failure:
            failures.append(failure)
            if os.getpid() != here:  # a launcher's process, whose list nobody reads
                say(f"error: {failure}", file=sys.stderr)

        return None

    sys.argv[1:] = words  # where Hydra reads them
    # Hydra raises its errors then, and `explain` makes one line of them.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    start = hydra.main(
        version_base="1.3", config_path="pkg://conf", config_name="config"
    )
    try:
        start(job)()
    except KeyFound as found:
        raise UserError(str(found)) from None
    except (HydraException, OmegaConfBaseException) as error:
        raise explain(error) from error
    except BrokenPipeError:
        raise
    except OSError as error:  # Hydra makes the run's folder
        # Without a name it is a full disk, or who reads what is printed.
        where = error.filename or "the run's folder, or the output"
        raise UserError(f"can't write {where}: {error.strerror}") from error

    if failures:
        raise failures[0]


def _add_sweep_words(words: list[str]) -> None:
    """Name a sweep's folder and what it optimises, unless ``words`` do, and say where the output of its jobs is."""
    from core.config.folders import new_folder, stamp

    flags = {word for word in words if word.startswith("-")}
    folders = [word.removeprefix(_FOLDER) for word in words if _FOLDER in word]
    if flags and flags <= _SWEEP and not folders:
        folders = [str(new_folder(f"multirun/{stamp()}"))]  # one for all jobs
        words.append(_FOLDER + folders[0])

    if "hydra/sweeper=optuna" in words:
        named = {word.partition("=")[0] for word in words}
        words += [
            f"{key}={value}" for key, value in _OPTUNA.items() if key not in named
        ]

    if any(word.startswith("hydra/launcher=submitit") for word in words):
        folder = folders[-1] if folders else "the sweep's folder"
        say(
            f"each run is a job of its own; what it prints is in {folder}/.submitit/",
            file=sys.stderr,
        )


if __name__ == "__main__":
    command(main)
