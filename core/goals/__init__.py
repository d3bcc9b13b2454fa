"""Say what a task wants in a form that programs can read, and make a reward of it::

    goals = (
        Placed(("cube",), place=(0.6, 0.0, 0.02), tolerance=0.01, rest=True),
        Untouched(("vase",)),
    )

A goal is of one of two sorts. A `Reach` wants bodies, or a joint, to end in some way, such as `Placed`. A `Limit` says
what must not happen meanwhile, such as `Untouched`. All of them say how far they were fulfilled (`Goal.share`), and how
far a rollout stayed from their limits (`Goal.margins`).

A kind is one class in one file, and a line here. `goal` has what all kinds share, `reaching` what a `Reach` does,
`limit` a `Limit`. They are judged by `evidence`, measure by `measures`, and scene files say them by `keys`.
"""

# ruff: noqa: I001 - names that are handed on (`X as X`) stand together

from core.goals.evidence import (
    Conduct as Conduct,
    Evidence as Evidence,
)
from core.goals.goal import (
    Given as Given,
    Goal as Goal,
)
from core.goals.inside import EMPTY as EMPTY
from core.goals.keys import (
    AboveZero as AboveZero,
    Bound as Bound,
    Direction as Direction,
    Key as Key,
    Least as Least,
    Most as Most,
    Names as Names,
)
from core.goals.limit import (
    Breach as Breach,
    Limit as Limit,
    limits as limits,
)
from core.goals.measures import (
    SLIP_DEG as SLIP_DEG,
    SLIP_M as SLIP_M,
    SLIP_RAD as SLIP_RAD,
    Measure as Measure,
)
from core.goals.phrases import (
    Coordinate as Coordinate,
    Coordinates as Coordinates,
)
from core.goals.reaching import (
    Reach as Reach,
    find_wants as find_wants,
    numbered as numbered,
    reaches as reaches,
)
from core.goals.rewards import (
    Aim as Aim,
    are_goals_met as are_goals_met,
    goals_margins as goals_margins,
    goals_reward as goals_reward,
    goals_shares as goals_shares,
    limits_margins as limits_margins,
)
from core.goals.sites import (
    ANY_BODY as ANY_BODY,
    BREAKABLE as BREAKABLE,
    FREE_BODY as FREE_BODY,
    JOINT as JOINT,
    SOLID_BODY as SOLID_BODY,
    Site as Site,
    Space as Space,
    find_names as find_names,
    list_names as list_names,
)
from core.goals.wants import Want as Want
from core.values.spans import Span as Span

# The kinds, in the order in which an entry of several keys has them.
# isort: off
from core.goals.placed import Placed as Placed
from core.goals.inside import Inside as Inside
from core.goals.away import Away as Away
from core.goals.joint_at import JointAt as JointAt
from core.goals.apart import Apart as Apart
from core.goals.flattened import Flattened as Flattened
from core.goals.spread import Spread as Spread
from core.goals.turned import Turned as Turned
from core.goals.turned_by import TurnedBy as TurnedBy
from core.goals.facing import Facing as Facing
from core.goals.kept import Kept as Kept
from core.goals.untouched import Untouched as Untouched
from core.goals.broken import Broken as Broken
from core.goals.unbroken import Unbroken as Unbroken
from core.goals.throughout import Throughout as Throughout
# isort: on

KINDS: tuple[type[Goal], ...] = tuple(
    kind
    for kind in [*globals().values()]
    if isinstance(kind, type)
    and issubclass(kind, Goal)
    and kind not in (Goal, Reach, Limit)
)
"""The kinds that scene files know: those that are imported here."""
