"""Bodies as solids: what is held, what is in the way, and what passes through what."""
