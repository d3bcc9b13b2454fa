"""Write programs for an arm's controller, from the templates that its robot brings.

A template gets ``robot``, ``payload`` (see `payload.py`), ``moves`` (by name, each a `Sampled`), and the function
``every(move, seconds)``. Covered by `tests/plugins/results/workshop/test_export.py`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
from jinja2.sandbox import SandboxedEnvironment

from core.errors import UserError
from core.support.cli import write_bytes
from core.values.robots import Robot
from plugins.results.workshop.motion import Sampled


def write_programs(robot: Robot, payload: Mapping[str, Any], moves: Mapping[str, Sampled], folder: Path) -> None:
    """Render the templates of `Robot.programs` to files in a folder.

    Raises:
        UserError: a template can't be rendered, or a file can't be written.
    """
    environment = SandboxedEnvironment(undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    for name, template in robot.programs:
        try:
            text = environment.from_string(template).render(robot=robot, payload=payload, moves=moves, every=every)
        except jinja2.TemplateError as error:
            raise UserError(f"robot {robot.name}: its program {name} can't be written: {error}") from error
        write_bytes(folder / name, (text + "\n").encode())


def every(move: Sampled, seconds: float) -> list[tuple[float, list[float]]]:
    """Pick the samples nearest to multiples of ``seconds``, and the last: time and joints."""
    wanted = np.append(np.arange(0.0, move.times[-1], seconds), move.times[-1])
    chosen = np.unique(np.searchsorted(move.times, wanted - 1e-9))
    return [(float(move.times[k]), np.round(move.positions[k], 6).tolist()) for k in chosen.tolist()]
