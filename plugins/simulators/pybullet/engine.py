"""Import PyBullet without the line that its C code prints on import; and call it for one of its worlds."""

import weakref
from functools import partial
from typing import Any

from core.errors import UserError
from plugins.simulators.quiet import quiet

try:
    with quiet():
        import pybullet
except ModuleNotFoundError as error:
    raise UserError(
        "sim=pybullet needs PyBullet: pip install pybullet (wheels exist for Linux and Python 3.11 or older)"
    ) from error


class Client:
    """A world without a window, of this ``number``: PyBullet without ``physicsClientId`` in each of its calls."""

    def __init__(self) -> None:
        self.number = pybullet.connect(pybullet.DIRECT)
        weakref.finalize(self, pybullet.disconnect, self.number)

    def __getattr__(self, name: str) -> Any:
        found = getattr(pybullet, name)
        self.__dict__[name] = (
            partial(found, physicsClientId=self.number) if callable(found) else found
        )
        return self.__dict__[name]


__all__ = ["Client", "pybullet"]
