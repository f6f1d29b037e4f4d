"""Meta-model of coefficients: a network from a design's parameters to the numbers of its law."""
