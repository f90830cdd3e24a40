"""The command line; each command loads the numeric libraries only after the threads are set."""
