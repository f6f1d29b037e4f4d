"""Files that are read with a doubt, and files that are refused."""

from __future__ import annotations

import numpy as np
from tests.lab_files.lab_file import LabFile, digits, rows, text
from tests.lab_files.written import (
    DEG,
    KPA,
    MBAR,
    MS,
    A,
    P,
    T,
    named,
)


def doubted() -> list[LabFile]:
    """Return files that are read as written and doubted; correct once the user has stated the meaning."""
    frozen = DEG.copy()
    frozen[15:40] = frozen[15]
    return [
        LabFile(
            "degrees called radians",
            {"a.csv": text("time_s,pressure_pa,angle_rad", *rows(T, P, DEG))},
            named("a"),
            stated={"units": {"angle_rad": "deg"}},
            doubts=("angle_rad", "deg"),
        ),
        LabFile(
            "radians called degrees",
            {"a.csv": text("time_s,pressure_pa,angle_deg", *rows(T, P, A))},
            named("a"),
            stated={"units": {"angle_deg": "rad"}},
            doubts=("angle_deg", "rad"),
        ),
        LabFile(
            "mbar called Pa",
            {"a.csv": text("time_s,pressure_pa,angle_deg", *rows(T, MBAR, DEG))},
            named("a"),
            stated={"units": {"pressure_pa": "mbar"}},
            doubts=("pressure_pa", "mbar"),
        ),
        LabFile(
            "milliseconds called seconds",
            {"a.csv": text("time_s,pressure_pa,angle_deg", *rows(MS, P, DEG))},
            named("a"),
            stated={"units": {"time_s": "ms"}},
            doubts=("time_s", "ms"),
        ),
        LabFile(
            "absolute pressure",
            {"a.csv": text("time_s,pressure_kpa,angle_deg", *rows(T, KPA + 101.3, DEG))},
            named("a"),
            stated={"zero": {"pressure_kpa": "101.3 kPa"}},
            doubts=("absolute", "zero"),
        ),
        LabFile(
            "an angle with a zero that is off",
            {"a.csv": text("time_s,pressure_kpa,angle_deg", *rows(T, KPA, DEG + 12.5))},
            named("a"),
            stated={"zero": {"angle_deg": "12.5 deg"}},
            doubts=("angle", "zero"),
        ),
        LabFile(
            "a pressure sensor that saturates",
            {"a.csv": text("time_s,pressure_kpa,angle_deg", *rows(T, np.minimum(KPA, 10.0), DEG))},
            {"a": {"time_s": T, "pressure_pa": np.minimum(P, 10_000.0), "angle_rad": A}},
            doubts=("pressure", "saturat"),
        ),
        LabFile(
            "a camera that froze",
            {"a.csv": text("time_s,pressure_kpa,angle_deg", *rows(T, KPA, frozen))},
            {"a": {"time_s": T, "pressure_pa": P, "angle_rad": np.radians(frozen)}},
            doubts=("angle", "frozen"),
        ),
    ]


def refused() -> list[LabFile]:
    """Return files refused with one sentence that states the remedy; some can be read once something is stated."""
    thousands = [f"{int(p) // 1000}.{int(p) % 1000:03d},0" if p >= 1000 else f"{int(p)},0" for p in P]
    return [
        LabFile(
            "thousands with points, decimals with commas",
            {
                "a.csv": text(
                    "time_s;pressure_pa;angle_deg",
                    *(
                        f"{digits(t, ',')};{p};{digits(a, ',')}"
                        for t, p, a in zip(T, thousands, DEG, strict=True)
                    ),
                )
            },
            named("a"),
            stated={"decimal": ","},
            refused=("two ways", "decimal"),
        ),
        LabFile(
            "a slip of the pen in a name",
            {"a.csv": text("time_s,pressure_kpa,angel_deg", *rows(T, KPA, DEG))},
            named("a"),
            stated={"rename": {"angel_deg": "angle_deg"}},
            refused=("angel_deg", "angle_deg", "rename"),
        ),
        LabFile(
            "a column that means nothing to us",
            {"a.csv": text("time_s,pressure_kpa,kanal_3", *rows(T, KPA, DEG))},
            named("a"),
            stated={"rename": {"kanal_3": "angle_rad"}, "units": {"kanal_3": "deg"}},
            refused=("kanal_3", "rename"),
        ),
        LabFile("no header", {"a.csv": text(*rows(T, P, A))}, refused=("header",)),
        LabFile(
            "decimal commas between commas, without quotes",
            {"a.csv": text("time_s,pressure_kpa,angle_deg", *rows(T, KPA, DEG, decimal=","))},
            refused=("decimal",),
        ),
        LabFile(
            "two columns of one name",
            {"a.csv": text("time_s,pressure_pa,angle_deg,angle_deg", *rows(T, P, DEG, DEG))},
            refused=("angle_deg", "2 times"),
        ),
        LabFile("a PDF", {"a.pdf": b"%PDF-1.7\n%\xe2\xe3\xcf\xd3\n1 0 obj"}, refused=("PDF", "CSV")),
        LabFile("an old spreadsheet", {"a.xls": b"\xd0\xcf\x11\xe0" + bytes(600)}, refused=("xlsx",)),
        LabFile(
            "MATLAB 7.3", {"a.mat": b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(200)}, refused=("-v7",)
        ),
        LabFile("JSON lines", {"a.csv": text('{"t": 0, "p": 1}', '{"t": 1, "p": 2}')}, refused=("header",)),
        LabFile("an empty file", {"a.csv": b""}, refused=("empty",)),
        LabFile(
            "nothing that drives",
            {"a.csv": text("time_s,angle_deg", *rows(T, DEG))},
            refused=("pressure", "angle_deg"),
        ),
    ]
