import pytest

from tests.benchmarks import interrupts


@pytest.mark.weekly
@pytest.mark.parametrize("name", interrupts.COMMANDS)
def test_a_signal_ends_a_command_and_all_that_it_began(name, tmp_path):
    interrupts.write_designs(tmp_path)
    ending = interrupts.interrupt(name, "TERM", 8.0, tmp_path)
    assert ending is not None
    assert ending.status == 130
    assert ending.said.startswith("interrupted")
