"""A law as a function of NumPy, torch or JAX: the texts differ only in the names of a few functions."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np

from pliant_export.tape import ARITHMETIC, COMPARISONS, INPUT, NUMBER, SELECT, TAKE, Tape
from pliant_export.written_law import WrittenLaw

WIDTH = 110


@dataclass(frozen=True)
class Dialect:
    """How a library writes the steps of a tape.

    Attributes:
        library: the name that precedes functions.
        head: imports and helpers.
        functions: names of functions whose name in the library differs from `name`.
        take: expression of a table and indices.
        array: conversion of a NumPy array to one of the library's in double precision.
        cast: of a result to the precision of the inputs, which selecting between two numbers may have raised.
    """

    library: str
    head: str
    functions: dict[str, str]
    take: str
    array: str
    cast: str = ""


OF_NUMPY = {"min": "np.minimum", "max": "np.maximum", SELECT: "np.where"}
OF_NUMPY |= {"and": "np.logical_and", "or": "np.logical_or", "not": "np.logical_not"}
NUMPY = Dialect("np", "import numpy as np", OF_NUMPY, "TABLE[{place}.astype(int)]", "{}")
JAX = Dialect(
    "jnp",
    "import jax.numpy as jnp\nimport numpy as np\n\n"
    "# For more than seven digits: jax.config.update('jax_enable_x64', True)",
    {name: f"j{function}" for name, function in OF_NUMPY.items()},
    "jnp.asarray(TABLE)[{place}.astype(int)]",
    "jnp.asarray({})",
)
TORCH = Dialect(
    "torch",
    "import numpy as np\nimport torch\n\n\ndef _smaller(a, b):\n    return torch.where(a < b, a, b)\n\n\n"
    "def _larger(a, b):\n    return torch.where(a > b, a, b)\n\n\n"
    "def _select(test, yes, no):\n"
    "    if not torch.is_tensor(yes) and not torch.is_tensor(no):  # single precision may not hold them\n"
    "        yes, no = torch.tensor([yes, no], dtype=torch.float64, device=test.device)\n"
    "    return torch.where(test, yes, no)\n",
    {
        "min": "_smaller",
        "max": "_larger",
        SELECT: "_select",
        "and": "torch.logical_and",
        "or": "torch.logical_or",
        "not": "torch.logical_not",
    },
    "torch.as_tensor(TABLE, dtype={place}.dtype, device={place}.device)[{place}.long()]",
    "torch.as_tensor({})",
    ".to(u.dtype)",
)
DIALECTS = {"numpy": NUMPY, "torch": TORCH, "jax": JAX}


def in_python(law: WrittenLaw, dialect: str) -> str:
    """Return the text of a module with the function `NAME(p, u)`; see its docstring."""
    how = DIALECTS[dialect]
    about = "\n".join(textwrap.fill(line, WIDTH) for line in law.about)
    parts = [
        f'"""Joint law \'{law.name}\' for {dialect}, written by Pliant. It needs {dialect} alone.\n\n{about}\n'
        'python <this file> --check compares it with the check file beside it.\n"""',
        f"import json\nimport sys\nfrom pathlib import Path\n\n{how.head}",
        f"# Low and high of each actuation, then of each axis.\nDOMAIN = np.array({_rows(law)})",
    ]
    if law.band is not None:
        parts.append(f"BAND_90 = np.array({[float(value) for value in law.band]!r})")
    if len(law.tape.table):
        parts.append("TABLE = " + table_text(law.tape))
    parts.append(inside_text())
    return "\n\n".join(parts) + "\n\n\n" + function_text(law, how) + "\n\n\n" + check_text(law, how) + "\n"


def table_text(tape: Tape) -> str:
    """Return the table of the tape as an array expression."""
    numbers = ", ".join(repr(float(value)) for value in tape.table)
    body = textwrap.fill(numbers, WIDTH, initial_indent="    ", subsequent_indent="    ")
    return f"np.array([\n{body}\n])"


def inside_text() -> str:
    """Return the text of the function that checks whether points are in the domain."""
    return (
        "\ndef inside(p, u):\n"
        '    """(n,) whether the law has data at p (n,) or (n, m) and u (n, a)."""\n'
        "    at = np.column_stack([np.asarray(p), np.asarray(u)])\n"
        "    return np.all((at >= DOMAIN[:, 0]) & (at <= DOMAIN[:, 1]), axis=1)"
    )


def function_text(law: WrittenLaw, how: Dialect, table: str = "TABLE") -> str:
    """Return the text of the function alone."""
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
        stacked = f"{stack}([{columns}], {axis}){how.cast}"
        said.append(f"{stacked}.reshape({shape})" if shape else stacked)
    lines += ["    return (", *(f"        {one}," for one in said), "    )"]
    return "\n".join(lines)


CHECK = '''def _check(path, law={name}):
    """How far the law is off the check file's outputs, as a share of the largest of each; what is allowed."""
    whole = json.loads(Path(path).read_text(encoding="utf-8"))
    (points,) = [one["points"] for one in whole["laws"] if one["law"] == "{name}"]
    at = np.array([point["inputs"] for point in points])
    p, u = at[:, {actuations}], at[:, {m}:]
    off = []
    for output, values in zip(("tau", "dtau_dp", "dtau_du"), law({p}, {u})):
        right = np.array([point[output] for point in points])
        off.append(abs(np.asarray(values).reshape(right.shape) - right).max() / (abs(right).max() or 1.0))
    return max(off), whole["tolerance"]["law_of_largest"]


if __name__ == "__main__":
    if "--check" not in sys.argv:
        sys.exit(__doc__){precision}
    here = Path(__file__)
    largest, near = _check(here.with_name(f"{{here.name}}.check.json"))
    print(f"off by {{largest:.2g}} of the largest (tolerance {{near:g}})")
    sys.exit(0 if largest <= near else 1)'''


def check_text(law: WrittenLaw, how: Dialect) -> str:
    """Return the text of the function that compares the law with its check file, and of the command that calls it."""
    return CHECK.format(
        name=law.name,
        actuations="0" if law.m == 1 else f":{law.m}",
        m=law.m,
        p=how.array.format("p"),
        u=how.array.format("u"),
        precision="\n    import jax\n\n    jax.config.update('jax_enable_x64', True)" if how is JAX else "",
    )


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
