"""The ``unseen`` listener: films the unseen layouts in which the best design of a run fails."""
