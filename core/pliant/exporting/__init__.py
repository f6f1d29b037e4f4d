"""Laws that leave Pliant: one list of steps (`tape`), read off a law's scalar function, written in other languages."""
