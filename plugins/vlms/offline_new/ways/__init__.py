"""The ways of using a tool that the embedded designer knows; a new one is a file here, and a line in `WAYS`."""

from plugins.vlms.offline_new.ways.cage import Cage
from plugins.vlms.offline_new.ways.grip import Grip, Hand
from plugins.vlms.offline_new.ways.hook import Hook
from plugins.vlms.offline_new.ways.lift import Lift
from plugins.vlms.offline_new.ways.push import Push
from plugins.vlms.offline_new.ways.scoop import Scoop
from plugins.vlms.offline_new.ways.sweep import Sweep
from plugins.vlms.offline_new.ways.throw import Throw
from plugins.vlms.offline_new.ways.way import Way

WAYS: tuple[Way, ...] = (
    Push(),
    Cage(),
    Sweep(),
    Hook(),
    Throw(),
    Lift(),
    Scoop(),
    Grip(),
    Hand(),
)
