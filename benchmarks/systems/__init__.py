"""Hidden effects in systems that others wrote: how often the diagnosis of a MuJoCo model names them."""
