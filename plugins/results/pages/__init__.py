"""Self-contained pages, pictures of tools, and what is read from the folders of runs."""
