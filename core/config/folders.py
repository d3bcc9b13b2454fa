"""Choose the folder of a new run, so that runs begun in the same second have one each."""

from __future__ import annotations

from datetime import datetime
from functools import cache
from pathlib import Path

from omegaconf import OmegaConf

MOST = 1000


def new_folder(name: str) -> str:
    """Make the folder, or where there is one of its name ``NAME_2``, ``NAME_3`` and so on; return its name.

    Where none can be made, the name is returned: what writes to it gives the reason.
    """
    for number in range(1, MOST + 1):
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


OmegaConf.register_new_resolver("new_folder", run_folder, replace=True)
