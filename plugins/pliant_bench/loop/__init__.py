"""The closed loop of an experiment: its folder, one run, one round, the end, the report."""
