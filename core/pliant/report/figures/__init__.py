"""Pictures of a finished run, one file per picture. Only `pliant.report` imports matplotlib."""
