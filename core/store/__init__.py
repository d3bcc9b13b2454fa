"""Keep a run on disk and read it back: database, recorder, progress, reader, files to take away."""
