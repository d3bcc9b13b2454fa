"""Import PyBullet without the line that its C code prints on import."""

import os
import sys

from core.errors import UserError

sys.stderr.flush()
_stderr, _nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
os.dup2(_nowhere, 2)
try:
    import pybullet
except ModuleNotFoundError as error:
    raise UserError(
        "sim=pybullet needs PyBullet: pip install pybullet (wheels exist for Linux and Python 3.11 or older); "
        "sim=mujoco is there on every system"
    ) from error
finally:
    os.dup2(_stderr, 2)
    os.close(_stderr)
    os.close(_nowhere)

__all__ = ["pybullet"]
