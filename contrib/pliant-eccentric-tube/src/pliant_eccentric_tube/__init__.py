"""A third-party Pliant family: the tube with its bore off the axis."""
