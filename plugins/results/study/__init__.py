"""Studies: methods compared on tasks with several seeds, as a file says; estimated first, then run, then reported."""
