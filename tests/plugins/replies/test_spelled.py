"""One sound design in the spellings of many models: what has one meaning is read as it, the rest names its fault."""

from pathlib import Path

import pytest
import yaml

from tests.support.spelled import read, spell

GROUPS = yaml.safe_load(Path(__file__).with_name("spelled.yaml").read_text())
ENTRIES = {
    f"{group}: {name}": entry
    for group, entries in GROUPS.items()
    for name, entry in entries.items()
}


@pytest.mark.parametrize("name", ENTRIES)
def test_a_spelling_is_read_as_the_sound_design_or_refused(name):
    entry = ENTRIES[name]
    (sound,), _ = read(spell({"reply": "DOC"}))
    assert sound.problem is None

    found, reasons = read(spell(entry))

    good = [candidate for candidate in found if candidate.problem is None]
    expected = entry.get("n", 1)
    assert len(found) == expected or expected == 0
    assert (
        [c.content for c in good] == [sound.content] * (expected - bool(reasons))
        if expected
        else not good
    )
    assert bool(reasons) == ("fault" in entry), reasons
    assert entry.get("fault", "") in " ".join(reasons)
