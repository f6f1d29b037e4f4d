"""A law as a function of NumPy, torch or JAX: the same text but for the names of a few functions."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np

from pliant.exporting.tape import ARITHMETIC, COMPARISONS, INPUT, NUMBER, SELECT, TAKE, Tape
from pliant.exporting.written_law import WrittenLaw

WIDTH = 110


@dataclass(frozen=True)
class Dialect:
    """How a library writes what the tape does.

    Attributes:
        library: the name that functions stand behind.
        head: imports and helpers.
        functions: names that differ from the library's own `name`.
        take: of a table and places.
    """

    library: str
    head: str
    functions: dict[str, str]
    take: str


OF_NUMPY = {"min": "np.minimum", "max": "np.maximum", SELECT: "np.where"}
OF_NUMPY |= {"and": "np.logical_and", "or": "np.logical_or", "not": "np.logical_not"}
NUMPY = Dialect("np", "import numpy as np", OF_NUMPY, "TABLE[{place}.astype(int)]")
JAX = Dialect(
    "jnp",
    "import jax.numpy as jnp\nimport numpy as np\n\n"
    "# For more than seven digits: jax.config.update('jax_enable_x64', True)",
    {name: f"j{function}" for name, function in OF_NUMPY.items()},
    "jnp.asarray(TABLE)[{place}.astype(int)]",
)
TORCH = Dialect(
    "torch",
    "import numpy as np\nimport torch\n\n\ndef _smaller(a, b):\n    return torch.where(a < b, a, b)\n\n\n"
    "def _larger(a, b):\n    return torch.where(a > b, a, b)",
    {
        "min": "_smaller",
        "max": "_larger",
        SELECT: "torch.where",
        "and": "torch.logical_and",
        "or": "torch.logical_or",
        "not": "torch.logical_not",
    },
    "torch.as_tensor(TABLE, dtype={place}.dtype, device={place}.device)[{place}.long()]",
)
DIALECTS = {"numpy": NUMPY, "torch": TORCH, "jax": JAX}


def in_python(law: WrittenLaw, dialect: str) -> str:
    """The text of a module with the function `NAME(p, u)`; see its docstring."""
    how = DIALECTS[dialect]
    about = "\n".join(textwrap.fill(line, WIDTH) for line in law.about)
    parts = [
        f'"""Joint law \'{law.name}\' for {dialect}, written by Pliant. It needs {dialect} alone.\n\n{about}\n"""',
        how.head,
        f"# Low and high of each actuation, then of each axis.\nDOMAIN = np.array({_rows(law)})",
    ]
    if law.band is not None:
        parts.append(f"BAND_90 = np.array({[float(value) for value in law.band]!r})")
    if len(law.tape.table):
        parts.append("TABLE = " + table_text(law.tape))
    parts.append(inside_text())
    return "\n\n".join(parts) + "\n\n\n" + function_text(law, how) + "\n"


def table_text(tape: Tape) -> str:
    """The numbers that the tape takes from, as an array."""
    numbers = ", ".join(repr(float(value)) for value in tape.table)
    body = textwrap.fill(numbers, WIDTH, initial_indent="    ", subsequent_indent="    ")
    return f"np.array([\n{body}\n])"


def inside_text() -> str:
    """The function that says whether points are in the domain."""
    return (
        "\ndef inside(p, u):\n"
        '    """(n,) whether the law has data at p (n,) or (n, m) and u (n, a)."""\n'
        "    at = np.column_stack([np.asarray(p), np.asarray(u)])\n"
        "    return np.all((at >= DOMAIN[:, 0]) & (at <= DOMAIN[:, 1]), axis=1)"
    )


def function_text(law: WrittenLaw, how: Dialect, table: str = "TABLE") -> str:
    """The function alone."""
    m, a, tape = law.m, law.a, law.tape
    of_p = "(n,)" if m == 1 else f"(n, {m})"
    slopes = f"(n, {a})" if m == 1 else f"(n, {a}, {m})"
    places = ["p" if m == 1 else f"p[:, {k}]" for k in range(m)] + [f"u[:, {k}]" for k in range(a)]
    lines = [
        f"def {law.name}(p, u):",
        f'    """tau (n, {a}), dtau_dp {slopes} and dtau_du (n, {a}, {a}) of n joints: p {of_p}, u (n, {a})."""',
    ]
    lines += [f"    v{k} = {_operation(tape, k, places, how, table)}" for k in range(len(tape.steps))]
    lines.append("    none = 0.0 * u[:, 0]")  # gives a constant output the shape of the others
    stack = f"{how.library}.stack"
    axis = "-1"
    said = []
    for name, shape in (
        ("tau", ""),
        ("dtau_dp", "" if m == 1 else f"(-1, {a}, {m})"),
        ("dtau_du", f"(-1, {a}, {a})"),
    ):
        columns = ", ".join(f"none + v{k}" for k in tape.outputs[name])
        stacked = f"{stack}([{columns}], {axis})"
        said.append(f"{stacked}.reshape({shape})" if shape else stacked)
    lines += ["    return (", *(f"        {one}," for one in said), "    )"]
    return "\n".join(lines)


def _operation(tape: Tape, k: int, places: list[str], how: Dialect, table: str) -> str:
    step = tape.steps[k]
    values = [f"v{argument}" for argument in step.arguments]
    if step.name == NUMBER:
        return repr(step.number)
    if step.name == INPUT:
        return places[int(step.number)]
    if step.name in ARITHMETIC or step.name in COMPARISONS:
        return f"{values[0]} {step.name} {values[1]}"
    if step.name == TAKE:
        return how.take.format(place=values[0]).replace("TABLE", table)
    function = how.functions.get(step.name, f"{how.library}.{step.name}")
    return f"{function}({', '.join(values)})"


def _rows(law: WrittenLaw) -> str:
    rows = [[_number(low), _number(high)] for low, high in law.domain]
    return "[" + ", ".join(f"[{low}, {high}]" for low, high in rows) + "]"


def _number(value: float) -> str:
    if not np.isfinite(value):
        return "np.inf" if value > 0 else "-np.inf"
    return repr(float(value))
