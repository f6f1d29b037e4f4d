"""Push: a chain presses on a wall, at several places of the wall and levels of actuation."""
