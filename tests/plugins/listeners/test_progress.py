"""What is printed as generations end."""

from dataclasses import replace

from core.design import Candidate, Evaluation
from core.events import Generation
from core.plugins import event_hub, installed
from tests.core.run_folders import hook


def test_a_generation_says_what_was_rejected_and_what_was_not_tried(capsys):
    events = event_hub()
    events.register(installed().create("listener", "progress", {}))
    tried, like, heavy = (Candidate(hook(0.1), None, 1, 0, number) for number in range(3))
    good = Evaluation(tried, "ok", reward=0.5, distance_m=1.0)
    copied = replace(good, candidate=like, same_as=tried.id)
    generation = Generation(1, (good, copied, Evaluation(heavy, "rejected", reason="heavy")))
    events.hook.generation_finished(generation=generation)
    said = "best 0.500  mean 0.500  (3 candidates, 1 rejected, 1 not tried, as they hardly differ from others)"
    assert said in capsys.readouterr().err
