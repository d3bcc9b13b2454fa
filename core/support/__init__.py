"""Files, texts, threads, keys, and the command line."""
