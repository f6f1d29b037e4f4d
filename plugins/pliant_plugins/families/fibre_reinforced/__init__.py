"""A fibre-reinforced bending actuator: a tube wound with threads, with a sheet along one side."""
