"""Import Warp and MuJoCo Warp, or report what is missing; and find the device."""

from __future__ import annotations

from typing import Any

from core.errors import UserError, choices
from plugins.simulators.quiet import quiet

try:
    import mujoco_warp
    import warp
    from mujoco_warp._src import solver
except ModuleNotFoundError as error:
    raise UserError(
        "sim=mujoco_warp needs MuJoCo Warp: pip install 'mujoco-warp>=4,<5' 'warp-lang>=1.19'"
    ) from error

# Otherwise it reports each kernel that it compiles, and a missing driver.
warp.config.log_level = warp.LOG_ERROR

# On a GPU, several groups of threads may sum the terms of one world's constraints, more groups for fewer worlds. A
# world's numbers would then depend on how many others there are. With many worlds each has one group anyway.
solver._JTDAJ_OVERSUBSCRIBE_WAVES = 0

DEVICES = ("cuda", "cpu")


def device(name: str) -> Any:
    """Find a device by name; ``cuda:1`` is the second of several GPUs.

    Raises:
        UserError: there is no such device here.
    """
    if name.partition(":")[0] not in DEVICES:
        raise choices("sim.device", name, DEVICES)
    with quiet():  # it reports a missing driver
        warp.init()
    cards = warp.get_cuda_devices()
    if name.startswith("cuda") and not cards:
        raise UserError(
            f"sim.device={name}: no graphics card with CUDA is found here; sim.device=cpu steps on the processor, and "
            "sim=mujoco does so faster"
        )

    try:
        return warp.get_device(name)
    except ValueError as error:
        have = ", ".join(card.alias for card in cards) or "none"
        raise UserError(
            f"sim.device={name}: there is no such graphics card; there are: {have}"
        ) from error


__all__ = ["device", "mujoco_warp", "warp"]
