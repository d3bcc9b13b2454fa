"""Say what a task wants in a form that programs can read, and make a reward of it::

    goals = (
        Placed(("cube",), place=(0.6, 0.0, 0.02), tolerance=0.01, rest=True),
        Untouched(("vase",)),
    )

A goal is of one of two sorts. A `Reach` wants bodies, or a joint, to end in some way: `Placed`, `Inside`, `Away`,
`JointAt`, `Apart`, `Flattened`, `Spread`, `Turned`, `TurnedBy`, `Facing` and `Broken`. A `Limit` says what must not
happen meanwhile: `Kept`, `Untouched`, `Unbroken` and `Throughout`. All of them say how far they were fulfilled
(`Goal.share`), and how far a rollout stayed from their limits (`Goal.margins`).

A new kind is one class, wherever it is written: a `Reach` says what it measures, a `Limit` what it leaves of a reward.
"""

from core.goals.apart import Apart
from core.goals.away import Away
from core.goals.base import (
    SLIP_DEG,
    SLIP_M,
    SLIP_RAD,
    Conduct,
    Coordinate,
    Coordinates,
    Evidence,
    Given,
    Goal,
    Limit,
    Measure,
    Reach,
    check_names,
    find_bans,
    find_wants,
    limits,
    needs_fixture,
    number_of,
    numbered,
    reaches,
)
from core.goals.broken import Broken
from core.goals.facing import Facing
from core.goals.flattened import Flattened
from core.goals.inside import EMPTY, Inside
from core.goals.joint_at import JointAt
from core.goals.kept import Kept
from core.goals.keys import AboveZero, Bound, Direction, Key, Least, Most, Names, Reads
from core.goals.placed import Placed
from core.goals.rewards import (
    Aim,
    goals_margins,
    goals_reward,
    goals_shares,
    limits_margins,
)
from core.goals.sites import (
    ANY_BODY,
    BREAKABLE,
    FREE_BODY,
    JOINT,
    SOLID_BODY,
    Site,
    Space,
    find_names,
    list_names,
)
from core.goals.spread import Spread
from core.goals.throughout import Throughout
from core.goals.turned import Turned
from core.goals.turned_by import TurnedBy
from core.goals.unbroken import Unbroken
from core.goals.untouched import Untouched
from core.goals.wants import Ban, Want
from core.values.spans import Span

KINDS: tuple[type[Goal], ...] = (
    Placed,
    Inside,
    Away,
    JointAt,
    Apart,
    Flattened,
    Spread,
    Turned,
    TurnedBy,
    Facing,
    Kept,
    Untouched,
    Broken,
    Unbroken,
    Throughout,
)
"""The kinds that scene files know, in the order in which an entry of several keys has them."""

__all__ = [
    "ANY_BODY",
    "BREAKABLE",
    "EMPTY",
    "FREE_BODY",
    "JOINT",
    "KINDS",
    "SLIP_DEG",
    "SLIP_M",
    "SLIP_RAD",
    "SOLID_BODY",
    "AboveZero",
    "Aim",
    "Apart",
    "Away",
    "Ban",
    "Bound",
    "Broken",
    "Conduct",
    "Coordinate",
    "Coordinates",
    "Direction",
    "Evidence",
    "Facing",
    "Flattened",
    "Given",
    "Goal",
    "Inside",
    "JointAt",
    "Kept",
    "Key",
    "Least",
    "Limit",
    "Measure",
    "Most",
    "Names",
    "Placed",
    "Reach",
    "Reads",
    "Site",
    "Space",
    "Span",
    "Spread",
    "Throughout",
    "Turned",
    "TurnedBy",
    "Unbroken",
    "Untouched",
    "Want",
    "check_names",
    "find_bans",
    "find_names",
    "find_wants",
    "goals_margins",
    "goals_reward",
    "goals_shares",
    "limits",
    "limits_margins",
    "list_names",
    "needs_fixture",
    "number_of",
    "numbered",
    "reaches",
]
