"""The ways of using a tool that the embedded designer knows; a new one is a file here, and a line in `WAYS`."""

from plugins.vlms.offline_new.ways.cage import Cage
from plugins.vlms.offline_new.ways.lift import Lift
from plugins.vlms.offline_new.ways.push import Push
from plugins.vlms.offline_new.ways.way import Way

WAYS: tuple[Way, ...] = (Push(), Cage(), Lift())
