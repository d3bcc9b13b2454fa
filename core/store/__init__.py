"""Keep a run on disk and read it: database, recorder, progress, reader, and the files of the best design."""
