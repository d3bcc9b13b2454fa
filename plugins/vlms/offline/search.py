"""Search for designs: draw values for the parameters of a way, or change those of elites, and keep the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from core.design import Tool
from core.designs.rules import given_tool
from core.errors import UserError
from core.interfaces import Brief
from plugins.vlms.offline.faults import (
    Faults,
    count_hits,
    find_faults,
    find_places,
)
from plugins.vlms.offline.given import draw_head
from plugins.vlms.offline.layout import Layout
from plugins.vlms.offline.making import (
    Made,
    change_shaft,
    draw_values,
    make,
    plan,
    plan_given,
)
from plugins.vlms.offline.mounting import draw_mount
from plugins.vlms.offline.notes import read_note
from plugins.vlms.offline.options import Option, list_options
from plugins.vlms.offline.recipe import SHAFTS, Mount, Recipe, Values

_TRIES = 5  # for a design without faults
_MOST_TRIES = 40  # while none keeps the rules


class NothingSuits(UserError):
    """No way of using a tool suits what is asked; the message says what that is."""


class Search:
    """Searches for designs in a layout of a brief's task.

        search = Search(brief)
        made = search.invent()
        another = search.replan(made)

    Its random numbers are those of the brief's seed: the same calls in the same order give the same designs.

    Attributes:
        brief: what is asked for.
        layout: that is searched.
        given: the tool for which plans alone are asked for; None: tools are asked for.
        options: the ways that suit it.
        rng: random numbers.

    Args:
        brief: what is asked for.

    Raises:
        NothingSuits: no way of using a tool suits the task.
    """

    def __init__(self, brief: Brief) -> None:
        self.brief = brief
        self.layout = Layout(
            brief.task, brief.scene_seed, brief.representation.material
        )
        self.rng = np.random.default_rng(brief.seed)
        self.given = given_tool(brief.representation, brief.task)
        self.options = list_options(self.layout, brief.task, brief.gripper, self.given)
        if not self.options:
            kind = "on fingers" if brief.gripper else "on the flange"
            raise NothingSuits(
                f"the embedded designer knows no way of using a tool {kind} for {brief.task.name}; ask a model, or an "
                "agent"
            )

    def find_option(self, way: str, number: int) -> Option | None:
        """Find an option by the name of its way and the number of its alternative; None: it is none here."""
        for option in self.options:
            if option.way.name == way and option.number == number:
                return option
        return None

    def invent(self) -> Made:
        """Draw a tool and a plan."""
        return self.find_best(self._draw, self.given)

    def _draw(self) -> Made:
        """Draw an option, and all values."""
        if self.given is not None:
            return self._plan_given(self.given)

        option = self._draw_option(self.options)
        way = option.way
        values = draw_values(way.ranges, self.rng)
        if way.bolted:
            return make(option, Recipe(values))
        return self._choose_shaft(option, values, draw_mount(option, values, self.rng))

    def _plan_given(self, tool: Tool) -> Made:
        """Draw a plan for a given tool: as it was made to be used, or else with what may be its head."""
        note = read_note(tool)
        alike = []
        if note is not None:
            alike = [option for option in self.options if option.way.name == note.way]

        option = self._draw_option(alike or self.options)
        way = option.way
        values = draw_values(way.ranges, self.rng)
        if note is not None and alike:
            moves = {name: values[name] for name in way.moves}
            recipe = Recipe({**note.values[0], **moves}, note.mount)
            pose = note.mount.pose if note.mount else None
            return plan_given(option, recipe, tool, pose)

        pose = None
        if tool.components or not way.bare:
            pose = draw_head(tool, self.layout, self.rng)
        return plan_given(option, Recipe(values), tool, pose)

    def _draw_option(self, options: Sequence[Option]) -> Option:
        """Draw one of some options."""
        weights = np.array([option.weight for option in options])
        return options[int(self.rng.choice(len(weights), p=weights / weights.sum()))]

    def _choose_shaft(self, option: Option, values: Values, mount: Mount) -> Made:
        """Make a design with the first kind of shaft that meets nothing, or else the one that meets the least."""
        best = make(option, Recipe(values, mount))
        places = find_places(best, self.layout)
        least = count_hits(best, self.layout, places)
        for shaft in SHAFTS:
            if least == 0:
                break
            other = change_shaft(best, shaft)
            hits = count_hits(other, self.layout, places, least)
            if hits < least:
                best = other
                least = hits

        return best

    def replan(self, made: Made) -> Made:
        """Draw another plan for a tool."""
        moves = made.option.way.moves

        def draw() -> Made:
            drawn = draw_values(moves, self.rng)
            return plan(made, {**made.recipe.values, **drawn})

        return self.find_best(draw, made.tool)

    def find_best(self, draw: Callable[[], Made], tool: Tool | None = None) -> Made:
        """Draw designs until one has no faults, and return the best.

        Args:
            draw: makes a design.
            tool: which all have that is known to keep the rules; None: each has its own.
        """
        best = draw()
        least = self._find_faults(best, np.inf, tool)

        for tried in range(1, _MOST_TRIES):
            if least == Faults() or (tried >= _TRIES and not least.refused):
                break

            most_hits = np.inf
            if not (least.refused or least.unreached):
                most_hits = least.hits

            other = draw()
            faults = self._find_faults(other, most_hits, tool)
            if faults < least:
                best = other
                least = faults

        return best

    def _find_faults(self, made: Made, most_hits: float, tool: Tool | None) -> Faults:
        """Find the faults of a design, of which no more than so many hits count."""
        keeps_rules = made.tool is tool
        return find_faults(made, self.layout, most_hits, keeps_rules=keeps_rules)
