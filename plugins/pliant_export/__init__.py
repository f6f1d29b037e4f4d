"""Export of laws: a list of steps (`tape`), derived from a law's scalar function, written in other languages."""
