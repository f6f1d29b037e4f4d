"""Preambles that are as wide as the table, and names that are less specific than Pliant's."""

from __future__ import annotations

import numpy as np
from tests.lab_files.captures import TIP, X, Z
from tests.lab_files.lab_file import SAMPLES, LabFile, digits, part, rows, text
from tests.lab_files.written import (
    BOTH,
    DEG,
    FAST,
    KPA,
    MBAR,
    ONE,
    PSI,
    TPA,
    P,
    T,
    both,
    named,
    spreadsheet,
    stamps,
)

DEG_BOTH = np.round(np.degrees(both("angle_rad")), 2)
HEAD = "Zeit [s];Druck [mbar];Winkel [°]"
GERMAN = rows(T, MBAR, DEG, between=";", decimal=",")


def preambles() -> list[LabFile]:
    """Return files with lines above the header that have its number of separators, and lines of words below it."""
    runs = ["slow_1"] * SAMPLES
    return [
        LabFile(
            "a German tester's preamble as wide as its table",
            {
                "a.csv": text(
                    "Messprotokoll Softfinger Modul 3;;;",
                    "Datum;02.08.2026;;",
                    "Prüfer;M. Müller;;",
                    ";;;",
                    "Versuch;Zeit [s];Druck [mbar];Winkel [°]",
                    *rows(runs, T, MBAR, DEG, between=";", decimal=","),
                    encoding="latin-1",
                )
            },
            {"slow_1": ONE["slow"]},
        ),
        LabFile(
            "a preamble that fills every column",
            {"a.csv": text("Projekt;Ort;Prüfer", "Softfinger;Stuttgart;M. Müller", HEAD, *GERMAN)},
            named("a"),
        ),
        LabFile(
            "a preamble with numbers in every column",
            {"a.csv": text("Kanal;1;2", "Name;A;B", "Verstärkung;0,5;0,7", "Offset;0,1;0,2", HEAD, *GERMAN)},
            named("a"),
        ),
        LabFile(
            "words of quantities in the preamble",
            {"a.csv": text("Datum;Uhrzeit;", "02.08.2026;10:00:00;", HEAD, *GERMAN)},
            named("a"),
        ),
        LabFile(
            "a preamble wider than the table",
            {
                "a.csv": text(
                    "Gerät;DL850;Firmware;1.23;Seriennummer;91J;Kalibriert;2026",
                    "Prüfer;M. Müller;",
                    HEAD,
                    *GERMAN,
                )
            },
            named("a"),
        ),
        LabFile(
            "a line of channels below the header",
            {"a.csv": text(HEAD, "Kanal A;Kanal B;Kanal C", *GERMAN)},
            named("a"),
        ),
        LabFile(
            "channels above the header, units below it",
            {"a.csv": text("Kanal A;Kanal B;Kanal C", "Zeit;Druck;Winkel", "s;mbar;°", *GERMAN)},
            named("a"),
        ),
        LabFile(
            "xlsx: a form above the table, as wide as it",
            {
                "a.xlsx": spreadsheet(
                    {
                        "Messung": [
                            ("Prüfer", "M. Müller", None),
                            ("Ort", "Stuttgart", "Halle 2"),
                            ("Zeit [s]", "Druck [mbar]", "Winkel [°]"),
                            *zip(T.tolist(), MBAR.tolist(), DEG.tolist(), strict=True),
                        ]
                    }
                )
            },
            named("a"),
        ),
        LabFile(
            "numbers without a header, and words between them",
            {"a.csv": text(*GERMAN[:30], "Pause;Pause;Pause", *GERMAN[30:])},
            refused=("header",),
        ),
        LabFile(
            "units written out",
            {"a.csv": text("Time (Seconds),Pressure (Kilopascals),Bend Angle (Degrees)", *rows(T, KPA, DEG))},
            named("a"),
        ),
    ]


def names() -> list[LabFile]:
    """Return columns that are proposed by their names, units and numbers, or ignored."""
    head = "Elapsed time (s),Pressure (kPa),Angle (deg)"
    pressures = both("pressure_pa") / 1000
    trials = ["First"] * SAMPLES + ["Second"] * SAMPLES
    chambers = {"time_s": T, "angle_rad": ONE["slow"]["angle_rad"]}
    return [
        LabFile(
            "commanded and actual pressures, an operator",
            {
                "a.csv": text(
                    "Time,Operator,Commanded PSI,Actual PSI,X pos,Z pos",
                    *rows(stamps("%H:%M:%S.%f"), ["ab"] * SAMPLES, np.round(PSI), PSI, X, Z),
                )
            },
            {"a": TIP},
            stated={
                "rename": {"Actual PSI": "pressure_pa", "X pos": "tip_x_m", "Z pos": "tip_z_m"},
                "units": {"Actual PSI": "psi", "X pos": "mm", "Z pos": "mm"},
            },
            refused=('"Actual PSI": pressure_pa', '"X pos": tip_x_m', '"Z pos": mm  # by its range'),
        ),
        LabFile(
            "trials in words, a pressure that was measured",
            {
                "a.csv": text(
                    "trial,Elapsed time (s),Commanded_pressure_seg_3,Measured_pressure_seg_3,Angle (deg)",
                    *rows(trials, both("time_s"), np.round(pressures), pressures, DEG_BOTH),
                )
            },
            part(*TPA, runs=("slow", "fast"), called=("First", "Second")),
            stated={
                "rename": {"trial": "run", "Measured_pressure_seg_3": "pressure_pa"},
                "units": {"Measured_pressure_seg_3": "kPa"},
            },
            refused=('"trial": run', '"Measured_pressure_seg_3": pressure_pa'),
        ),
        LabFile(
            "a column Trial and a clock that begins again",
            {"a.csv": text(f"Trial,{head}", *rows(trials, both("time_s"), pressures, DEG_BOTH))},
            part(*TPA, runs=("slow", "fast"), called=("First", "Second")),
            stated={"rename": {"Trial": "run"}},
            refused=("'rename: {Trial: run}'", "restarts"),
        ),
        LabFile(
            "a column Subject and a clock that begins again",
            {"a.csv": text(f"{head},Subject", *rows(both("time_s"), pressures, DEG_BOTH, trials))},
            part(*TPA, runs=("slow", "fast"), called=("First", "Second")),
            stated={"rename": {"Subject": "run"}},
            refused=("'rename: {Subject: run}'", "restarts"),
        ),
        LabFile(
            "trials of states without time",
            {"a.csv": text("Trial,Pressure (kPa),Angle (deg)", *rows(trials, pressures, DEG_BOTH))},
            {
                called: {name: values for name, values in BOTH[run].items() if name != "time_s"}
                for called, run in (("First", "slow"), ("Second", "fast"))
            },
            stated={"rename": {"Trial": "run"}},
            doubts=("Trial", "rename: {Trial: run}"),
        ),
        LabFile(
            "three measured pressures with numbers",
            {
                "a.csv": text(
                    "time_s,Measured_pressure_seg_1,Measured_pressure_seg_2,angle_deg",
                    *rows(T, KPA, KPA / 2, DEG),
                )
            },
            {"a": {**chambers, "pressure_1_pa": P, "pressure_2_pa": P / 2}},
            stated={
                "rename": {
                    "Measured_pressure_seg_1": "pressure_1_pa",
                    "Measured_pressure_seg_2": "pressure_2_pa",
                },
                "units": {"Measured_pressure_seg_1": "kPa", "Measured_pressure_seg_2": "kPa"},
            },
            refused=('"Measured_pressure_seg_1": pressure_1_pa', '"Measured_pressure_seg_2": pressure_2_pa'),
        ),
        LabFile(
            "a counter of rows and steps of motors",
            {
                "a.csv": text(
                    "sample,time_s,motor_1_steps,motor_2_steps,angle_deg",
                    *(
                        f"{k},{digits(t)},{k},{-k},{digits(a)}"
                        for k, (t, a) in enumerate(zip(T, DEG, strict=True))
                    ),
                )
            },
            {
                "a": {
                    **chambers,
                    "tendon_travel_1_m": np.arange(SAMPLES) * 1e-5,
                    "tendon_travel_2_m": -np.arange(SAMPLES) * 1e-5,
                }
            },
            stated={
                "rename": {"motor_1_steps": "tendon_travel_1_m", "motor_2_steps": "tendon_travel_2_m"},
                "units": {"motor_1_steps": "0.01 mm", "motor_2_steps": "0.01 mm"},
            },
            refused=('"motor_1_steps": tendon_travel_1_m',),
        ),
        LabFile(
            "a curvature about the camera's x",
            {"a.csv": text("time_s,pressure_kpa,curvature_x_1_per_m", *rows(T, KPA, DEG / 10))},
            {"a": {"time_s": T, "pressure_pa": P, "curvature_y_1_per_m": DEG / 10}},
            stated={"rename": {"curvature_x_1_per_m": "curvature_y_1_per_m"}},
            refused=("curvature about x", "curvature_y_1_per_m"),
        ),
        LabFile(
            "names that say nothing",
            {"a.csv": text("time_s,ch0,ch1", *rows(T, KPA, DEG))},
            named("a"),
            stated={"rename": {"ch0": "pressure_kpa", "ch1": "angle_deg"}},
            refused=("ch0, ch1", "rename"),
        ),
        LabFile(
            "a humidity beside the pressure",
            {
                "a.csv": text(
                    "time_s,pressure_kpa,Humidity [%],Biegung [°]", *rows(T, KPA, FAST["time_s"], DEG)
                )
            },
            named("a"),
            stated={"rename": {"Biegung [°]": "angle_rad"}},
            refused=('"Biegung [°]": angle_rad',),
        ),
    ]
