"""Motion capture and video tracking: headers of several lines, with rates and units of length above them.

Written by hand in the layouts that the programs export; all contain the slow run. Motive and TRC have y up, so that
world z is in their column Y.
"""

from __future__ import annotations

import numpy as np
from tests.lab_files.lab_file import SAMPLES, LabFile, digits, part, rows, text
from tests.lab_files.written import DEG, KPA, MBAR, MS, SLOW, T

X, Z = 1000 * SLOW["tip_x_m"], 1000 * SLOW["tip_z_m"]  # mm
NIL = np.zeros(SAMPLES)
FRAME = np.arange(SAMPLES)
TIP = part("time_s", "pressure_pa", "tip_x_m", "tip_z_m")["slow"]
ANGLE = part("time_s", "pressure_pa", "angle_rad")["slow"]
LOGGER = {"logger.csv": text("t_ms;p_mbar", *rows(MS, MBAR, between=";", decimal=","))}
JOIN = {"join": {"file": "logger.csv"}}
Y_UP = ("tip:X [mm]", "tip:Y [mm]")


def renamed(x: str, z: str) -> dict[str, dict[str, str]]:
    return {"rename": {x: "tip_x_m", z: "tip_z_m"}}


def camera(name: str, file: str, content: bytes, x: str, z: str, **stated: object) -> LabFile:
    """Return two loggers: positions of a camera, pressures of another clock that began with it."""
    return LabFile(
        name,
        LOGGER | {file: content},
        {file.partition(".")[0]: TIP},
        stated={**JOIN, **renamed(x, z), **stated},
        refused=("join",),
    )


def motive(*levels: str, unit: str = "Millimeters", rate: str = "25.000000") -> list[str]:
    return [
        "Format Version,1.23,Take Name,finger,Take Notes,,Capture Frame Rate,100.000000,Export Frame Rate,"
        f"{rate},Capture Start Time,2026-08-02 10.00.00.000 AM,Total Frames in Take,61,Rotation Type,Quaternion,"
        f"Length Units,{unit},Coordinate Space,Global",
        "",
        *levels,
    ]


def captures() -> list[LabFile]:
    """Return files of OptiTrack, Vicon, Qualisys, TRC, DeepLabCut and Tracker."""
    body = [np.full(SAMPLES, value) for value in (0.1, 0.2, 0.3, 0.9)]
    return [
        camera(
            "OptiTrack Motive: one marker",
            "take.csv",
            text(
                *motive(
                    ",Type,Marker,Marker,Marker",
                    ",Name,tip,tip,tip",
                    ",ID,01,01,01",
                    ",,Position,Position,Position",
                    "Frame,Time (Seconds),X,Y,Z",
                ),
                *rows(FRAME, T, X, Z, NIL),
            ),
            "X [mm]",
            "Y [mm]",
        ),
        camera(
            "OptiTrack Motive: two markers",
            "take.csv",
            text(
                *motive(
                    ",Type,Marker,Marker,Marker,Marker,Marker,Marker",
                    ",Name,base,base,base,tip,tip,tip",
                    ",ID,7A01,7A01,7A01,7A02,7A02,7A02",
                    ",,Position,Position,Position,Position,Position,Position",
                    "Frame,Time (Seconds),X,Y,Z,X,Y,Z",
                ),
                *rows(FRAME, T, NIL, NIL, NIL, X, Z, NIL),
            ),
            *Y_UP,
        ),
        camera(
            "OptiTrack Motive 3: a rigid body with its error, and a marker",
            "take.csv",
            text(
                *motive(
                    ",Type,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body,Rigid Body"
                    ",Marker,Marker,Marker",
                    ",Name,hand,hand,hand,hand,hand,hand,hand,hand,tip,tip,tip",
                    ",ID,01,01,01,01,01,01,01,01,02,02,02",
                    ",Parent,,,,,,,,,,,",
                    ",,Rotation,Rotation,Rotation,Rotation,Position,Position,Position,Mean Marker Error,Position"
                    ",Position,Position",
                    "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,,X,Y,Z",
                    unit="Meters",
                ),
                *rows(FRAME, T, *body, NIL, NIL, NIL, NIL, X / 1000, Z / 1000, NIL),
            ),
            "tip:Position:X [m]",
            "tip:Position:Y [m]",
        ),
        camera(
            "Vicon Nexus: markers over the first of their columns, the rate below 'Trajectories'",
            "trial.csv",
            text(
                "Trajectories",
                "25",
                ",,finger:base,,,finger:tip,,",
                "Frame,Sub Frame,X,Y,Z,X,Y,Z",
                ",,mm,mm,mm,mm,mm,mm",
                *rows(FRAME, NIL, NIL, NIL, NIL, X, NIL, Z),
            ),
            "finger:tip:X [mm]",
            "finger:tip:Z [mm]",
        ),
        camera(
            "Qualisys: no header, frames and times",
            "qtm.tsv",
            text(*qualisys(), *rows(FRAME, T, NIL, NIL, NIL, X, NIL, Z, between="\t")),
            "tip:X [mm]",
            "tip:Z [mm]",
        ),
        camera(
            "Qualisys: with column headers",
            "qtm.tsv",
            text(
                *qualisys(),
                "Frame\tTime\tbase X\tbase Y\tbase Z\ttip X\ttip Y\ttip Z",
                *rows(FRAME, T, NIL, NIL, NIL, X, NIL, Z, between="\t"),
            ),
            "tip:X [mm]",
            "tip:Z [mm]",
        ),
        camera(
            "Qualisys: positions alone, a row for each frame",
            "qtm.tsv",
            text(*qualisys(), *rows(NIL, NIL, NIL, X, NIL, Z, between="\t")),
            "tip:X [mm]",
            "tip:Z [mm]",
        ),
        LabFile(
            "rows without a clock, and their rate above them",
            {"a.csv": text("Sampling rate [Hz]: 25", "Pressure (kPa),Angle (deg)", *rows(KPA, DEG))},
            {"a": ANGLE},
            stated={"rate": "25 Hz"},
            doubts=("time_s", "rate: 25 Hz"),
        ),
        camera(
            "TRC: numbers behind the axes",
            "finger.trc",
            text(
                "PathFileType\t4\t(X/Y/Z)\tfinger.trc",
                "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
                "25.00\t25.00\t61\t2\tmm\t25.00\t1\t61",
                "Frame#\tTime\tbase\t\t\ttip\t\t",
                "\t\tX1\tY1\tZ1\tX2\tY2\tZ2",
                "",
                *rows(FRAME + 1, T, NIL, NIL, NIL, X, Z, NIL, between="\t"),
            ),
            *Y_UP,
            units={"Time": "s"},
        ),
        LabFile(
            "DeepLabCut: pixels",
            {
                "dlc.csv": text(
                    "scorer,DLC_resnet50,DLC_resnet50,DLC_resnet50,DLC_resnet50,DLC_resnet50,DLC_resnet50",
                    "bodyparts,tip,tip,tip,base,base,base",
                    "coords,x,y,likelihood,x,y,likelihood",
                    *rows(FRAME, X * 10, Z * 10, NIL + 1, NIL, NIL, NIL + 1),
                )
            }
            | LOGGER,
            {"dlc": TIP},
            stated={
                **JOIN,
                **renamed("tip:x", "tip:y"),
                "units": {"tip:x": "0.1 mm", "tip:y": "0.1 mm"},
                "rate": "25 Hz",
            },
            refused=("rate",),
        ),
        LabFile(
            "Tracker: a name of the mass above t, x and y",
            {
                "tracker.txt": text("multi:\tmass_A\t", "t\tx\ty", *rows(T, X, Z, between="\t")),
            }
            | LOGGER,
            {"tracker": TIP},
            stated={**JOIN, **renamed("x", "y"), "units": {"t": "s", "x": "mm", "y": "mm"}},
            refused=("clock", "unit"),
        ),
        LabFile(
            "the rate and the unit of length among keys and values",
            {
                "a.csv": text(
                    "Take Name,finger8 2026-08-02",
                    "Export Frame Rate,25",
                    "Length Units,Millimeters",
                    "",
                    "Frame,Tip X,Tip Z,Pressure (kPa)",
                    *rows(FRAME, X, Z, KPA),
                )
            },
            {"a": TIP},
        ),
        LabFile(
            "a take exported at a quarter of its rate",
            {
                "a.csv": text(
                    "Capture Frame Rate,100.000000,Export Frame Rate,25.000000",
                    "Frame,Tip X (mm),Tip Z (mm),Pressure (kPa)",
                    *rows(FRAME, X, Z, KPA),
                )
            },
            {"a": TIP},
        ),
        LabFile(
            "a German camera: the rate with its unit in the key",
            {
                "a.csv": text(
                    "Prüfer;M. Müller;;",
                    "Bildrate [Hz];25,0;;",
                    "Bild;Spitze X [mm];Spitze Z [mm];Druck [kPa]",
                    *rows(FRAME, X, Z, KPA, between=";", decimal=","),
                    encoding="latin-1",
                )
            },
            {"a": TIP},
        ),
        LabFile(
            "two cameras with rates of their own",
            {
                "a.csv": text(
                    "Camera rate,25",
                    "Sample rate,50",
                    "Frame,Tip X (mm),Tip Z (mm),Pressure (kPa)",
                    *rows(FRAME, X, Z, KPA),
                )
            },
            {"a": TIP},
            stated={"rate": "25 Hz"},
            refused=("25 and 50 Hz", "rate"),
        ),
    ]


def qualisys() -> list[str]:
    return [
        f"NO_OF_FRAMES\t{SAMPLES}",
        "NO_OF_CAMERAS\t8",
        "NO_OF_MARKERS\t2",
        "FREQUENCY\t25",
        "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2026-08-02, 10:00:00.000\t12345.678",
        "DATA_INCLUDED\t3D",
        "MARKER_NAMES\tbase\ttip",
        "TRAJECTORY_TYPES\tMeasured\tMeasured",
    ]


def testers() -> list[LabFile]:
    """Return files of tensile testers, which are for `pliant calibrate`: loads and extensions drive no chain."""
    load, way = np.round(0.1 * FRAME, 3), np.round(0.5 * FRAME, 3)
    return [
        LabFile(
            "Instron Bluehill",
            {
                "a.csv": text(
                    '"Specimen label","A1"',
                    '"Time","Extension","Load","Tensile strain"',
                    '"(s)","(mm)","(N)","(mm/mm)"',
                    *(
                        f'"{digits(t)}","{digits(w)}","{digits(f)}","{digits(w / 25)}"'
                        for t, w, f in zip(T, way, load, strict=True)
                    ),
                )
            },
            refused=("Extension", "Load", "calibrate"),
        ),
        LabFile(
            "Zwick testXpert",
            {
                "a.txt": text(
                    "Prüfer;M. Müller;",
                    "Vorkraft;0,1;N",
                    "Prüfzeit;Standardweg;Standardkraft",
                    "s;mm;N",
                    *rows(T, way, load, between=";", decimal=","),
                    encoding="latin-1",
                )
            },
            refused=("Standardweg", "Standardkraft", "calibrate"),
        ),
        LabFile(
            "MTS",
            {
                "a.txt": text(
                    "Data Header:\tTime:\t10.25\tSec\t2026-08-02 10:00:00",
                    "Axial Displacement\tAxial Force\tRunning Time",
                    "mm\tkN\tSec",
                    *rows(way, load / 1000, T, between="\t"),
                )
            },
            refused=("Axial Displacement", "Axial Force", "calibrate"),
        ),
        LabFile(
            "Shimadzu Trapezium",
            {
                "a.csv": text(
                    '"Key Word","","Product Name",""',
                    '"1 _ 1","1 _ 1","1 _ 1"',
                    '"Time","Force","Stroke"',
                    '"sec","N","mm"',
                    *rows(T, load, way),
                )
            },
            refused=("Force", "Stroke", "calibrate"),
        ),
    ]
