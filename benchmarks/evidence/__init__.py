"""The hidden-effect test bed: measurements whose truth is known to the judge only, and the bench of the diagnoser."""
