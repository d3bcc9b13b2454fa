"""The candidates of which a prompt tells most."""

from dataclasses import replace

from plugins.vlms.telling import last_generation, most_telling, outcome_of
from tests.support.tried import SEEN, tried


def test_the_last_generation_is_the_one_with_the_highest_number():
    assert [
        e.candidate.id
        for e in last_generation(
            [tried(1), tried(1, generation=2), tried(0, generation=2)]
        )
    ] == [
        "g2-a0-s0-p0",
        "g2-a0-s0-p1",
    ]
    assert last_generation([]) == ()


def test_the_most_instructive_failure_is_the_best_of_the_most_frequent_class():
    dropped = replace(SEEN, result="dropped")
    solved = tried(0, 1.0, replace(SEEN, result="solved"))
    few = [tried(1, 0.9), tried(2, 0.1, dropped), tried(3, 0.2, dropped), solved]
    assert [e.candidate.id for e in most_telling([], few)] == [
        "g0-a0-s0-p3",
        "g0-a0-s0-p1",
    ]
    assert list(most_telling([solved], few))[:2] == [solved, few[2]]
    assert list(most_telling([], [solved])) == []
    rejected = tried(0, status="rejected", reason="no")
    assert list(most_telling([], [rejected])) == []
    assert outcome_of(few[0]) == "missed"
