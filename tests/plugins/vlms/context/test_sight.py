"""What feedback says of bodies to a designer that is told no number of them."""

import re
from dataclasses import replace

from core.plugins import installed
from core.values.observations import Moved
from plugins.vlms.context.sight import Hidden


def test_texts_lose_the_numbers_of_bodies_alone():
    sight = Hidden.for_layout(installed().create("task", "PastGlasses"), 0)
    text = "glass_2 moved by 0.013 m, 12 mm at most, to (0.1, 0.2, 0.30) at 2.31 s; card_3 in 3 of 5 layouts, -0.5"
    assert sight.text(text) == (
        "glass_2 moved by some m, some mm at most, to somewhere at 2.31 s; card_3 in 3 of 5 layouts, some"
    )
    assert sight.text("component 'rod' has 0.4 m") == "component 'rod' has 0.4 m"


def test_limits_that_the_prompt_says_are_no_secrets():
    task = installed().create("task", "PastGlasses")
    sight = Hidden.for_layout(task, 0)
    sight = replace(sight, said=frozenset(["20mm"]))
    text = "glass_2 pressed with 15.02 N, 15 N allowed; glass_2 moved by 32 mm, 20 mm allowed"
    assert sight.text(text) == (
        "glass_2 pressed with 15.02 N, 15 N allowed; glass_2 moved by some mm, 20 mm allowed"
    )


def test_a_way_is_what_the_picture_shows():
    task = installed().create("task", "BringCube")
    sight = Hidden.for_layout(task, 0)
    assert (
        sight.way(Moved((0.0, 0.0, 0.0005), (0.6, 0.0, 0.1), 0.0))
        == "not seen in the picture"
    )
    assert re.fullmatch(
        r"in the picture up by \d+ % of its height",
        sight.way(Moved((0, 0, 0.1), (0.55, 0.0, 0.1), 0)),
    )
