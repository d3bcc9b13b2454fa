"""What is printed as generations end."""

from core.design import Candidate
from core.events import Generation
from core.plugins import event_hub, installed
from plugins.conformance.evaluations import tried_once
from tests.core.run_folders import hook


def test_a_generation_says_how_many_were_rejected(capsys):
    events = event_hub()
    events.register(installed().create("listener", "progress", {}))
    tried, heavy = (Candidate(hook(0.1), None, 1, 0, number) for number in range(2))
    good = tried_once(tried, "ok", reward=0.5, distance_m=1.0)
    generation = Generation(1, (good, tried_once(heavy, "rejected", reason="heavy")))
    events.hook.generation_finished(generation=generation)
    said = "best 0.500  mean 0.500  (2 candidates, 1 rejected)"
    assert said in capsys.readouterr().err
