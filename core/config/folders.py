"""Name and make the folders of runs, also from within a configuration."""

from __future__ import annotations

import itertools
from datetime import datetime
from pathlib import Path

from omegaconf import DictConfig


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


def notes_folder(folder: str) -> str | None:
    """Name the folder in a run's folder for Hydra's notes; None: a run is there already, whose notes stay."""
    return None if (Path(folder) / "run.sqlite").exists() else ".hydra"


def stamp() -> str:
    """Return the local time as it stands in the names of folders."""
    return datetime.now().strftime("%Y-%m-%d_%H-%M-%S")


def task_folder(task: DictConfig) -> str:
    """Name a task in the names of folders: one that stands in a file by the file's name."""
    file = task.get("file")
    stem = Path(file).stem.strip(".") if isinstance(file, str) else ""
    return stem or str(task.name)
