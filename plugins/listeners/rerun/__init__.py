"""The ``rerun`` listener: a recording of a run for the Rerun viewer (https://rerun.io)."""
