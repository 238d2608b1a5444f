"""Results of a run: the data set and its files, the detector's judgements, plots."""
