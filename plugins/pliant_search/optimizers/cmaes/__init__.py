"""CMA-ES by pycma: a normal distribution that learns where the objective is low."""
