"""Imports PyBullet, without the line that it prints from C when it is imported."""

import os
import sys

from core.errors import UserError

sys.stdout.flush()
_stdout = os.dup(1)
_nowhere = os.open(os.devnull, os.O_WRONLY)
os.dup2(_nowhere, 1)
try:
    import pybullet
except ModuleNotFoundError as error:
    raise UserError(
        "sim=pybullet needs PyBullet: pip install pybullet (wheels exist for Linux and Python 3.11 or older)"
    ) from error
finally:
    os.dup2(_stdout, 1)
    os.close(_stdout)
    os.close(_nowhere)

__all__ = ["pybullet"]
