"""Polish of a search's best candidates: descents over the real variables, by slopes through the equilibrium."""
