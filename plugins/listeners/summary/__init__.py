"""The ``summary`` listener: says more of the winner of a run, and what to type next; then what failed, and why."""
