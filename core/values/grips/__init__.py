"""Say what holds on to a body: a suction cup, a magnet, an adhesive pad or hook-and-loop on a face of a tool.

A kind is one class in one file, with its figures and their sources, and a line here. `grip` has what all share.
"""

from __future__ import annotations

from core.values.grips.adhesive import Adhesive
from core.values.grips.grip import (
    FACES as FACES,
)
from core.values.grips.grip import (
    MAX_AREA_MM2 as MAX_AREA_MM2,
)
from core.values.grips.grip import (
    MIN_AREA_MM2 as MIN_AREA_MM2,
)
from core.values.grips.grip import (
    TOUCH_M as TOUCH_M,
)
from core.values.grips.grip import (
    Grip as Grip,
)
from core.values.grips.grip import (
    Gripped as Gripped,
)
from core.values.grips.grip import (
    Limit as Limit,
)
from core.values.grips.grip import (
    Load as Load,
)
from core.values.grips.grip import (
    Surface as Surface,
)
from core.values.grips.hook_and_loop import HookAndLoop
from core.values.grips.magnet import Magnet
from core.values.grips.suction import Suction

GRIPS: dict[str, type[Grip]] = {
    kind.kind: kind for kind in (Suction, Magnet, Adhesive, HookAndLoop)
}
"""The kinds, by name."""
