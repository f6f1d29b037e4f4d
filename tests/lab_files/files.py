"""Files that are read: European CSV, spreadsheets, LabVIEW, MATLAB, cameras, two loggers."""

from __future__ import annotations

from datetime import datetime, timedelta
from functools import cache

import numpy as np
from tests.lab_files.captures import captures, testers
from tests.lab_files.from_public import public
from tests.lab_files.from_reports import reported
from tests.lab_files.headers import names, preambles
from tests.lab_files.lab_file import SAMPLES, LabFile, digits, part, rows, text
from tests.lab_files.refused_files import doubted, refused
from tests.lab_files.written import (
    BAR,
    BOTH,
    DEG,
    FAST,
    KPA,
    MBAR,
    MS,
    ONE,
    PSI,
    SLOW,
    TPA,
    A,
    P,
    T,
    both,
    matlab,
    named,
    parquet,
    spreadsheet,
    stamps,
)


@cache
def lab_files() -> list[LabFile]:
    """Return all files, made once."""
    return [
        *(*european(), *instruments(), *spreadsheets(), *clocks(), *several(), *doubted(), *refused()),
        *(*captures(), *testers(), *preambles(), *names(), *public(), *reported()),
    ]


def european() -> list[LabFile]:
    """Return files with varied separators, decimals, encodings, words and units."""
    names = ["slow"] * SAMPLES
    german = rows(names, MS, MBAR, DEG, between=";", decimal=",")
    return [
        LabFile(
            "plain, Pliant's own names",
            {"a.csv": text("run,time_s,pressure_pa,angle_rad", *rows(names, T, P, A))},
            ONE,
        ),
        LabFile(
            "German, semicolons, decimal commas, Latin-1",
            {"a.csv": text("Messung;Zeit [ms];Druck [mbar];Winkel [°]", *german, encoding="latin-1")},
            ONE,
        ),
        LabFile(
            "German, semicolons, UTF-8 with a mark, Windows line ends",
            {
                "a.csv": text(
                    "Messung;Zeit [ms];Druck [mbar];Winkel [deg]", *german, encoding="utf-8-sig", ends="\r\n"
                )
            },
            ONE,
        ),
        LabFile(
            "Excel's Unicode text: UTF-16, tabs",
            {
                "a.txt": text(
                    "Messung\tZeit (s)\tDruck (kPa)\tBiegewinkel (Grad)",
                    *rows(names, T, KPA, DEG, between="\t", decimal=","),
                    encoding="utf-16",
                )
            },
            ONE,
        ),
        LabFile(
            "DIN 1313: quantity / unit",
            {
                "a.csv": text(
                    "t / s;p / kPa;Winkel / °", *rows(T, KPA, DEG, between=";", decimal=","), encoding="utf-8"
                )
            },
            named("a"),
        ),
        LabFile(
            "semicolons with decimal points",
            {"a.csv": text("time [s];pressure [bar];angle [deg]", *rows(T, BAR, DEG, between=";"))},
            named("a"),
        ),
        LabFile(
            "English words, psi",
            {"a.csv": text("Time (s),Pressure (psi),Bend angle (deg)", *rows(T, PSI, DEG))},
            named("a"),
        ),
        LabFile(
            "units in a second line",
            {"a.csv": text("Time,Pressure,Angle", "s,kPa,deg", *rows(T, KPA, DEG))},
            named("a"),
        ),
        LabFile(
            "German words, units in brackets in a second line, empty columns at the end",
            {
                "a.csv": text(
                    "Zeit;Druck;Winkel;;",
                    "[ms];[mbar];[°];;",
                    *(line + ";;" for line in rows(MS, MBAR, DEG, between=";", decimal=",")),
                    ";;;;",
                    ";;;;",
                )
            },
            named("a"),
        ),
        LabFile(
            "quoted decimal commas between commas",
            {
                "a.csv": text(
                    '"time_s","pressure_kpa","angle_deg"',
                    *(
                        ",".join(f'"{digits(value, ",")}"' for value in row)
                        for row in zip(T, KPA, DEG, strict=True)
                    ),
                )
            },
            named("a"),
        ),
        LabFile(
            "columns between blanks, aligned",
            {
                "a.dat": text(
                    "    time_s   pressure_kpa   angle_deg",
                    *(f"{t:10.3f} {p:14.3f} {a:11.2f}" for t, p, a in zip(T, KPA, DEG, strict=True)),
                )
            },
            named("a"),
        ),
        LabFile(
            "numpy.savetxt: the header in a comment, blanks between",
            {"a.txt": text("# time_s pressure_pa angle_deg", *rows(T, P, DEG, between=" "))},
            named("a"),
        ),
        LabFile(
            "line ends of old Macs",
            {"a.csv": text("time_s,pressure_pa,angle_deg", *rows(T, P, DEG), ends="\r")},
            named("a"),
        ),
        LabFile(
            "exponents of Fortran",
            {
                "a.csv": text(
                    "time_s,pressure_pa,angle_deg",
                    *(
                        f"{t:.3f},{p:.6E},{a:.2f}".replace("E", "D")
                        for t, p, a in zip(T, P, DEG, strict=True)
                    ),
                )
            },
            named("a"),
        ),
        LabFile(
            "the tip in millimetres, elongation in percent",
            {
                "a.csv": text(
                    "Zeit [s];Druck [kPa];Tip X [mm];Tip Z [mm];Dehnung [%]",
                    *rows(
                        T,
                        KPA,
                        1000 * SLOW["tip_x_m"],
                        1000 * SLOW["tip_z_m"],
                        100 * SLOW["elongation_strain"],
                        between=";",
                    ),
                )
            },
            {
                "a": part("time_s", "pressure_pa", "tip_x_m", "tip_z_m", "elongation_strain")["slow"],
            },
        ),
    ]


def instruments() -> list[LabFile]:
    """Return files with lines above the header, as instruments and cameras write them."""
    return [
        LabFile(
            "LabVIEW, .lvm with two headers",
            {
                "a.lvm": text(
                    "LabVIEW Measurement\t",
                    "Writer_Version\t2",
                    "Separator\tTab",
                    "Decimal_Separator\t.",
                    "Operator\tlab",
                    "Date\t2026/08/02",
                    "***End_of_Header***\t",
                    "\t",
                    "Channels\t2\t",
                    "Samples\t61\t61",
                    "***End_of_Header***\t\t",
                    "X_Value\tPressure [kPa]\tAngle [deg]\tComment",
                    *(line + "\t" for line in rows(T, KPA, DEG, between="\t")),
                )
            },
            named("a"),
        ),
        LabFile(
            "a preamble of keys and values, then tabs",
            {
                "a.txt": text(
                    "Experiment: finger 3",
                    "Operator: M. Mustermann",
                    "Sampling rate [Hz]: 25",
                    "",
                    "Time [s]\tPressure [mbar]\tAngle [deg]",
                    *rows(T, MBAR, DEG, between="\t"),
                )
            },
            named("a"),
        ),
        LabFile(
            "a data logger: commas in the preamble too",
            {
                "a.csv": text(
                    "Model,DL850",
                    "Start Time,2026/08/02,10:00:00",
                    "Sample Rate,25,Hz",
                    "Channels,2",
                    "Time [ms],Pressure [bar],Angle [mrad]",
                    *rows(MS, BAR, np.round(1000 * A, 9)),
                )
            },
            named("a"),
        ),
        LabFile(
            "a camera: frames, and the rate above them",
            {
                "a.csv": text(
                    "# Tracker 6.1",
                    "# frame rate: 25 fps",
                    "frame,pressure_kpa,tip_x_mm,tip_z_mm",
                    *rows(np.arange(SAMPLES), KPA, 1000 * SLOW["tip_x_m"], 1000 * SLOW["tip_z_m"]),
                )
            },
            {"a": part("time_s", "pressure_pa", "tip_x_m", "tip_z_m")["slow"]},
        ),
        LabFile(
            "frames without a rate",
            {"a.csv": text("frame,pressure_kpa,angle_deg", *rows(np.arange(SAMPLES), KPA, DEG))},
            named("a"),
            stated={"rate": "25 Hz"},
            refused=("frame", "rate"),
        ),
        LabFile(
            "an overload as text",
            {
                "a.csv": text(
                    "time_s,pressure_kpa,angle_deg",
                    *(
                        line if k != 20 else line.rpartition(",")[0] + ",OVERLOAD"
                        for k, line in enumerate(rows(T, KPA, DEG))
                    ),
                )
            },
            {"a": {**ONE["slow"], "angle_rad": np.where(np.arange(SAMPLES) == 20, np.nan, A)}},
            stated={"missing": ["OVERLOAD"]},
            refused=("OVERLOAD", "missing"),
        ),
        LabFile(
            "missing cells as spreadsheets and cameras write them",
            {
                "a.csv": text(
                    "time_s,pressure_kpa,angle_deg",
                    *(
                        line if k % 20 != 7 else line.rpartition(",")[0] + "," + ("#N/A", "-", "NaN")[k // 20]
                        for k, line in enumerate(rows(T, KPA, DEG))
                    ),
                )
            },
            {"a": {**ONE["slow"], "angle_rad": np.where(np.arange(SAMPLES) % 20 == 7, np.nan, A)}},
        ),
    ]


def spreadsheets() -> list[LabFile]:
    """Return Excel, MATLAB and Parquet files."""
    table = list(zip(T.tolist(), KPA.tolist(), DEG.tolist(), strict=True))
    record = {"time_s": T, "pressure_kpa": KPA, "angle_deg": DEG}
    return [
        LabFile(
            "xlsx",
            {"a.xlsx": spreadsheet({"Sheet1": [("time_s", "pressure_kpa", "angle_deg"), *table]})},
            named("a"),
        ),
        LabFile(
            "xlsx: a title, a row of units, a chart's sheet that is empty",
            {
                "a.xlsx": spreadsheet(
                    {
                        "Messung": [
                            ("Finger 3, August",),
                            (),
                            ("Zeit", "Druck", "Winkel"),
                            ("s", "kPa", "°"),
                            *table,
                        ],
                        "Diagramm": [],
                    }
                )
            },
            named("a"),
        ),
        LabFile(
            "xlsx with two tables",
            {
                "a.xlsx": spreadsheet(
                    {
                        "slow": [("time_s", "pressure_kpa", "angle_deg"), *table],
                        "old": [("time_s", "pressure_kpa", "angle_deg"), (0.0, 1.0, 2.0), (0.1, 1.0, 2.0)],
                    }
                )
            },
            named("a"),
            stated={"table": "slow"},
            refused=("'slow'", "'old'", "table"),
        ),
        LabFile(
            "xlsx with dates",
            {
                "a.xlsx": spreadsheet(
                    {
                        "S": [
                            ("time", "pressure_kpa", "angle_deg"),
                            *((datetime(2026, 8, 2, 10) + timedelta(seconds=t), p, a) for t, p, a in table),
                        ]
                    }
                )
            },
            named("a"),
        ),
        LabFile("MATLAB: a struct", {"a.mat": matlab({"data": record})}, named("a")),
        LabFile(
            "MATLAB: columns as variables, with a remark",
            {"a.mat": matlab({**record, "comment": "finger 3", "fs": 25.0})},
            named("a"),
        ),
        LabFile(
            "MATLAB: two structs",
            {
                "a.mat": matlab(
                    {"run1": record, "run2": {name: values[:9] for name, values in record.items()}}
                )
            },
            named("a"),
            stated={"table": "run1"},
            refused=("'run1'", "'run2'", "table"),
        ),
        LabFile("Parquet", {"a.parquet": parquet({k: np.array(v) for k, v in record.items()})}, named("a")),
    ]


def clocks() -> list[LabFile]:
    """Return files with dates, orders and clocks that begin again."""
    shuffled = np.random.default_rng(3).permutation(SAMPLES)
    head = "time,pressure_kpa,angle_deg"
    return [
        LabFile(
            "ISO dates",
            {"a.csv": text(head, *rows(stamps("%Y-%m-%dT%H:%M:%S.%f", -3), KPA, DEG))},
            named("a"),
        ),
        LabFile(
            "German dates with decimal commas",
            {
                "a.csv": text(
                    "Datum;Druck [kPa];Winkel [°]",
                    *rows(
                        [s[:-3] for s in stamps("%d.%m.%Y %H:%M:%S,%f")], KPA, DEG, between=";", decimal=","
                    ),
                )
            },
            named("a"),
        ),
        LabFile(
            "the time of day",
            {"a.csv": text(head, *rows(stamps("%H:%M:%S.%f", -3), KPA, DEG))},
            named("a"),
        ),
        LabFile(
            "rows out of order",
            {
                "a.csv": text(
                    "time_s,pressure_kpa,angle_deg", *rows(T[shuffled], KPA[shuffled], DEG[shuffled])
                )
            },
            named("a"),
            doubts=("sorted",),
        ),
        LabFile(
            "a clock that begins again, without names of runs",
            {
                "a.csv": text(
                    "time_s,pressure_pa,angle_deg",
                    *rows(both("time_s"), both("pressure_pa"), np.round(np.degrees(both("angle_rad")), 2)),
                )
            },
            part(*TPA, runs=("slow", "fast"), called=("a 1", "a 2")),
            stated={"restarts": "new run"},
            refused=("restarts",),
        ),
        LabFile(
            "states without time, in the order of the bench",
            {"a.csv": text("pressure_kpa,angle_deg", *rows(KPA[:31], DEG[:31]))},
            {"a": {"pressure_pa": P[:31], "angle_rad": A[:31]}},
        ),
    ]


def several() -> list[LabFile]:
    """Return measurements that consist of several files."""
    slow = text("time_s,pressure_kpa,angle_deg", *rows(T, KPA, DEG))
    fast_deg = np.round(np.degrees(FAST["angle_rad"]), 2)
    fast = text("time_s,pressure_kpa,angle_deg", *rows(T, FAST["pressure_pa"] / 1000, fast_deg))
    payload = {"payload_kg": np.full(SAMPLES, 0.02)}
    late = slice(10, 50)  # the camera's part of the recording; its clock begins with it
    camera = rows(T[late] - T[10], DEG[late])
    return [
        LabFile(
            "a file for each run",
            {"slow.csv": slow, "fast.csv": fast},
            BOTH,
        ),
        LabFile(
            "run, specimen and payload in the file's name",
            {"finger_s1_0g_slow.csv": slow, "finger_s1_20g_fast.csv": fast},
            {
                "slow": {**BOTH["slow"], "payload_kg": 0 * T},
                "fast": {**BOTH["fast"], **payload},
            },
            stated={"name_pattern": "finger_{specimen}_{payload_g}g_{run}"},
        ),
        LabFile(
            "two loggers with clocks of their own",
            {
                "pressure.csv": text("time_s,pressure_kpa", *rows(T, KPA)),
                "camera.csv": text("time_s,angle_deg", *camera),
            },
            {"camera": {"time_s": T[late] - T[10], "pressure_pa": P[late], "angle_rad": A[late]}},
            stated={"join": {"file": "pressure.csv", "shift": "-0.4 s"}},
            refused=("join",),
        ),
    ]
