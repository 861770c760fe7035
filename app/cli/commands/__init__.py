"""One module per command; each has `run(args) -> (json or None, exit status)`."""
