"""Which states of a module are solved: `plan` follows the strategy that the config names and keeps what is solved."""
