"""``evolution=refined``, or ``evolution.refine=N`` with any other: vary the numbers of what a strategy found."""
