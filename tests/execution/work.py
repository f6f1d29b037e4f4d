"""Work of the workers in the tests, in a module so that other processes can import it."""

import os
from pathlib import Path


def square(number):
    return number * number


def deadly(item):
    """Square the number, unless it is odd: then the process ends, as often as (number, folder, times) states."""
    number, folder, times = item
    with (Path(folder) / str(number)).open("a") as file:
        file.write(f"{os.getpid()}\n")
    if number % 2 and len((Path(folder) / str(number)).read_text().split()) <= times:
        os._exit(9)
    return number * number


def threads(_):
    return [os.environ.get(name) for name in ("OMP_NUM_THREADS", "MKL_NUM_THREADS")]
