"""Keep a run on disk and read it: database, recorder, progress, and reader."""
