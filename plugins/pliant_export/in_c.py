"""A law as a C header without dependencies: one point, many points, whether a point is in the domain."""

from __future__ import annotations

import textwrap

import numpy as np

from pliant_export.tape import ARITHMETIC, COMPARISONS, FUNCTIONS, INPUT, NUMBER, SELECT, TAKE, Tape
from pliant_export.written_law import WrittenLaw

# Points that `_many` evaluates together.
BLOCK = 64
LOGIC = {"and": "&&", "or": "||"}
WIDTH = 110


def in_c(law: WrittenLaw) -> str:
    """Return the text of the header (C99)."""
    name, tape = law.name, law.tape
    guard = f"{name.upper()}_H"
    usual = tape.usual(*_middle(law))
    domain = ", ".join(f"{{{_number(low)}, {_number(high)}}}" for low, high in law.domain)
    lines = [
        *_comment(
            [
                f"Joint law '{name}', written by Pliant. Needs nothing but the C library (C99; link with -lm).",
                *law.about,
            ]
        ),
        f"#ifndef {guard}",
        f"#define {guard}",
        "#include <math.h>",
        "#include <stddef.h>",
        "",
        f"enum {{ {name}_actuations = {law.m}, {name}_axes = {law.a} }};",
        "",
        "/* low and high of each actuation, then of each axis */",
        f"static const double {name}_domain[{law.m + law.a}][2] = {{{domain}}};",
    ]
    if law.band is not None:
        lines.append(
            f"static const double {name}_band_90[{law.a}] = {{{', '.join(map(_number, law.band))}}};"
        )
    if len(tape.table):
        numbers = ", ".join(map(_number, tape.table))
        table = textwrap.fill(numbers, WIDTH, initial_indent="    ", subsequent_indent="    ")
        lines += [f"static const double {name}_table[{len(tape.table)}] = {{", table, "};"]
    lines += ["", *_one(law), "", *_inside(law), "", *_many(law, usual), "", "#endif", ""]
    return "\n".join(lines)


def _one(law: WrittenLaw) -> list[str]:
    name, tape = law.name, law.tape
    places = [f"p[{k}]" for k in range(law.m)] + [f"u[{k}]" for k in range(law.a)]
    return [
        f"/* p[{law.m}], u[{law.a}] -> tau[{law.a}], dtau_dp[{law.a * law.m}] (axis by axis), "
        f"dtau_du[{law.a * law.a}] (row by row) */",
        f"static inline void {name}(const double *p, const double *u, double *tau, double *dtau_dp, double *dtau_du)",
        "{",
        *_body(tape, places, name),
        *(f"    {out}[{i}] = v{k};" for out, ks in tape.outputs.items() for i, k in enumerate(ks)),
        "}",
    ]


def _inside(law: WrittenLaw) -> list[str]:
    name = law.name
    tests = [
        f"{value} >= {name}_domain[{row}][0] && {value} <= {name}_domain[{row}][1]"
        for row, value in enumerate([f"p[{k}]" for k in range(law.m)] + [f"u[{k}]" for k in range(law.a)])
    ]
    joined = " &&\n        ".join(tests)
    return [
        "/* whether the law has data there */",
        f"static inline int {name}_inside(const double *p, const double *u)",
        "{",
        f"    return {joined};",
        "}",
    ]


def _many(law: WrittenLaw, usual: Tape) -> list[str]:
    """Return C code that evaluates blocks of points on the usual tape; others are evaluated again one by one."""
    name = law.name
    sizes = {"p": law.m, "u": law.a}
    outs = {"tau": ("tau", law.a), "dtau_dp": ("dp", law.a * law.m), "dtau_du": ("du", law.a * law.a)}
    places = [f"{array}[{_at(k)}]" for array, count in sizes.items() for k in range(count)]
    body = _body(usual, places, name, "            ")
    return [
        f"/* The same at n points; component k of point i stands at [k*n + i]; {BLOCK} points go through together",
        "   (let the compiler vectorise: -O3 -march=native). */",
        f"static inline void {name}_many(size_t n, const double *restrict p, const double *restrict u,",
        "    double *restrict tau, double *restrict dtau_dp, double *restrict dtau_du)",
        "{",
        f"    for (size_t start = 0; start < n; start += {BLOCK}) {{",
        f"        const size_t end = n - start < {BLOCK} ? n : start + {BLOCK};",
        f"        double unusual[{BLOCK}];",
        "        double some = 0.0;",
        "        for (size_t i = start; i < end; ++i) {",
        *body,
        *(
            f"            {out}[{_at(j)}] = v{k};"
            for out, ks in usual.outputs.items()
            if out != "unusual"
            for j, k in enumerate(ks)
        ),
        f"            unusual[i - start] = {_condition(usual, usual.outputs['unusual'][0])} ? 1.0 : 0.0;",
        "        }",
        "        for (size_t i = start; i < end; ++i) some += unusual[i - start];",
        "        if (some == 0.0) continue;",
        "        for (size_t i = start; i < end; ++i) {",
        "            if (unusual[i - start] == 0.0) continue;",
        f"            double one_p[{law.m}], one_u[{law.a}], one_tau[{law.a}];",
        f"            double one_dp[{law.a * law.m}], one_du[{law.a * law.a}];",
        *(
            f"            one_{array}[{k}] = {array}[{_at(k)}];"
            for array, c in sizes.items()
            for k in range(c)
        ),
        f"            {name}(one_p, one_u, one_tau, one_dp, one_du);",
        *(
            f"            {out}[{_at(j)}] = one_{short}[{j}];"
            for out, (short, count) in outs.items()
            for j in range(count)
        ),
        "        }",
        "    }",
        "}",
    ]


def _at(k: int) -> str:
    return "i" if k == 0 else f"{k}*n + i"


def _body(tape: Tape, places: list[str], name: str, indent: str = "    ") -> list[str]:
    """Return a line for each numeric step; conditions are written inline where they are used."""
    lines = []
    for k, step in enumerate(tape.steps):
        if _is_condition(tape, k):
            continue
        text = places[int(step.number)] if step.name == INPUT else _number(step.number)
        if step.name not in (INPUT, NUMBER):
            text = _operation(tape, k, name)
        lines.append(f"{indent}const double v{k} = {text};")
    return lines


def _operation(tape: Tape, k: int, name: str) -> str:
    step = tape.steps[k]
    values = [f"v{argument}" for argument in step.arguments]
    if step.name in ARITHMETIC:
        return f"{values[0]} {step.name} {values[1]}"
    if step.name in ("min", "max"):
        return f"{values[0]} {'<' if step.name == 'min' else '>'} {values[1]} ? {values[0]} : {values[1]}"
    if step.name == SELECT:
        return f"{_condition(tape, step.arguments[0])} ? {values[1]} : {values[2]}"
    if step.name == TAKE:
        return f"{name}_table[(size_t){values[0]}]"
    assert step.name in FUNCTIONS
    return f"{'fabs' if step.name == 'abs' else step.name}({values[0]})"


def _is_condition(tape: Tape, k: int) -> bool:
    return tape.steps[k].name in (*COMPARISONS, *LOGIC, "not")


def _condition(tape: Tape, k: int) -> str:
    step = tape.steps[k]
    if step.name in COMPARISONS:
        return f"(v{step.arguments[0]} {step.name} v{step.arguments[1]})"
    if step.name in LOGIC:
        one, other = (_condition(tape, argument) for argument in step.arguments)
        return f"({one} {LOGIC[step.name]} {other})"
    if step.name == "not":
        return f"(!{_condition(tape, step.arguments[0])})"
    return f"(v{k} != 0.0)"


def _middle(law: WrittenLaw) -> list[float]:
    """Return a point inside the domain off its middle, where odd terms would vanish."""
    low, high = np.clip(law.domain, -1.0, 1.0).T
    low = np.where(np.isfinite(law.domain[:, 0]), law.domain[:, 0], low)
    high = np.where(np.isfinite(law.domain[:, 1]), law.domain[:, 1], high)
    return [float(value) for value in low + 0.57 * (high - low)]


def _number(value: float) -> str:
    if not np.isfinite(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def _comment(lines: list[str]) -> list[str]:
    text = [part for line in lines for part in textwrap.wrap(line, WIDTH)]
    return [f"/* {text[0]}", *(f"   {line}" for line in text[1:-1]), f"   {text[-1]} */"]
