import psutil

from core.support.memory import release_memory


def test_memory_that_is_free_goes_back_to_the_system():
    process = psutil.Process()
    filled = [bytes(1000) for _ in range(100_000)]
    kept, held = filled[-1], process.memory_info().rss
    del filled
    release_memory()
    assert len(kept) == 1000  # it lies behind what was freed
    assert held - process.memory_info().rss > 50e6
