"""A tendon-driven joint: two rigid links, a soft flexure between them, a tendon below it."""
