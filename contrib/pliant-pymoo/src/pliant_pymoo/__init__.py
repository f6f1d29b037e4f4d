"""Third-party Pliant optimizers: differential evolution and NSGA-II of pymoo."""
