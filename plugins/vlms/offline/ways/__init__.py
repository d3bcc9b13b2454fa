"""The ways of using a tool that the embedded designer knows; a new one is a file here, and a line in `WAYS`."""

from plugins.vlms.offline.ways.cage import Cage
from plugins.vlms.offline.ways.grip import Grip, Hand
from plugins.vlms.offline.ways.hook import Hook
from plugins.vlms.offline.ways.key import Key
from plugins.vlms.offline.ways.lift import Lift
from plugins.vlms.offline.ways.pour import Pour
from plugins.vlms.offline.ways.press import Press
from plugins.vlms.offline.ways.pull import Pull
from plugins.vlms.offline.ways.push import Push
from plugins.vlms.offline.ways.scoop import Scoop
from plugins.vlms.offline.ways.sweep import Sweep
from plugins.vlms.offline.ways.throw import Drop, Throw
from plugins.vlms.offline.ways.way import Way

WAYS: tuple[Way, ...] = (
    Push(),
    Cage(),
    Sweep(),
    Hook(),
    Throw(),
    Drop(),
    Lift(),
    Key(),
    Scoop(),
    Pour(),
    Press(),
    Pull(),
    Grip(),
    Hand(),
)
