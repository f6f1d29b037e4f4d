"""What workers of the tests do; of a module, so that other processes find it."""

import os
from pathlib import Path


def square(number):
    return number * number


def deadly(item):
    """Square it, unless it is odd: then the process dies, as often as (number, folder, times) says."""
    number, folder, times = item
    with (Path(folder) / str(number)).open("a") as file:
        file.write(f"{os.getpid()}\n")
    if number % 2 and len((Path(folder) / str(number)).read_text().split()) <= times:
        os._exit(9)
    return number * number


def threads(_):
    return [os.environ.get(name) for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")]
