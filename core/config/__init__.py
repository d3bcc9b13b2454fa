"""Hold what may be configured: schemas, settings, composing, and what may change on resume."""
