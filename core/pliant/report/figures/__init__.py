"""Pictures of bodies and the style of all stills. Only `pliant.report` imports matplotlib."""
