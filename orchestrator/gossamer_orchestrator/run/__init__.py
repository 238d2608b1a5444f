"""Run a plan: the master, its channels, and what watches a run."""
