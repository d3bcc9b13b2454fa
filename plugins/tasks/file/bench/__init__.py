"""``vlmgineer scene``: a scene file from a sentence and photographs, which a model writes and this package checks."""
