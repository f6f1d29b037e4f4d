"""Files as public bug reports show them, each with this project's own numbers; the report stands in the docstring."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
from tests.lab_files.lab_file import SAMPLES, Columns, LabFile, digits, part, rows, text
from tests.lab_files.written import DEG, KPA, MS, ONE, TPA, P, T, named, stamps

HEAD = "time_s,pressure_kpa,angle_deg"
MICROS = MS * 1000
EPOCH_S = 1_609_060_336
LATE_S = 0.007  # by which a second sensor writes its row after the first
CHANGES_S = (0.0, 0.4, 1.2, 2.0)  # of a valve's commands, the last of which holds to the end
COMMANDS_KPA = (0.0, 10.0, 4.0, 0.0)


def reported() -> list[LabFile]:
    """Return the files of the reports."""
    return [
        *(angle_within_a_turn(), heading(), counter_of_32_bits(), signed_counter(), board_clock()),
        *(summer_time_ends(), stamps_with_offsets(), dates_with_offsets(), separator_line()),
        *(serial_monitor(), serial_monitor_without_a_header(), serial_plotter(), monitor_and_board()),
        *(
            rows_of_two_sensors(),
            held_in_rows_of_its_own(),
            log_of_changes(),
            multimeter(),
            units_without_a_name(),
        ),
        *(
            stamps_in_two_columns(),
            clock_coarser_than_rows(),
            durations_in_words(),
            overload_as_a_large_number(),
        ),
        *(asian_pressure(), *binary_files(), changed_range(), long_form(), vacuum()),
    ]


def angle_within_a_turn() -> LabFile:
    """Return a sensor that counts from −180° to 180° (opentrack/opentrack#833)."""
    degrees = np.round(5 * DEG, 2)
    within = np.round((degrees + 180) % 360 - 180, 2)
    return LabFile(
        "an angle that goes on at −180°",
        {"a.csv": text(HEAD, *rows(T, KPA, within))},
        {"a": {"time_s": T, "pressure_pa": P, "angle_rad": np.radians(degrees)}},
        stated={"wrap": {"angle_deg": "360 deg"}},
        doubts=("angle_deg jumps by 352°", "wrap: {angle_deg: 360 deg}"),
    )


def heading() -> LabFile:
    """Return the heading of an inertial sensor, from 0 to 360° (adafruit/Adafruit_BNO055#104)."""
    return LabFile(
        "a heading that passes north",
        {"a.csv": text(HEAD, *rows(T, KPA, np.round((DEG + 340) % 360, 2)))},
        named("a"),
        stated={"wrap": {"angle_deg": "360 deg"}, "zero": {"angle_deg": "340 deg"}},
        doubts=("angle_deg jumps", "wrap: {angle_deg: 360 deg}"),
    )


def counter_of_32_bits() -> LabFile:
    """Return the microseconds of a board, which begin again after 71.6 min (sparkfun/OpenLog_Artemis#57)."""
    micros = (MICROS + 2**32 - 1_000_000) % 2**32
    return LabFile(
        "microseconds that begin again",
        {"a.csv": text("time_us,pressure_kpa,angle_deg", *rows(micros, KPA, DEG))},
        {"a": {**ONE["slow"], "time_s": T + (2**32 - 1_000_000) / 1e6}},
        stated={"wrap": {"time_us": "4294967296 us"}},
        refused=("goes back", "counter of 32 bits", "wrap: {time_us: 4294967296 us}"),
    )


def signed_counter() -> LabFile:
    """Return the same counter as the report has it: printed with a sign, one row before the end."""
    micros = (MICROS + 2**32 - 2_400_000) % 2**32 - 2**31
    return LabFile(
        "microseconds with a sign that begin again in the last row",
        {"a.csv": text("time_us,pressure_kpa,angle_deg", *rows(micros, KPA, DEG))},
        {"a": {**ONE["slow"], "time_s": T + (2**31 - 2_400_000) / 1e6}},
        stated={"wrap": {"time_us": "4294967296 us"}},
        refused=("counter of 32 bits", "wrap"),
    )


def board_clock() -> LabFile:
    """Return a clock called as the function of the board that it is of: its unit is known."""
    return LabFile(
        "millis of a board", {"a.csv": text("millis,pressure_kpa,angle_deg", *rows(MS, KPA, DEG))}, named("a")
    )


def _wall_clock(pattern: str, offset: bool) -> list[str]:
    """Return the stamps of the recording in the night when summer time ends, one second before three o'clock."""
    found = []
    for seconds in T:
        stamp = datetime(2026, 10, 25, 2, 59, 59) + timedelta(seconds=float(seconds))
        over = stamp >= datetime(2026, 10, 25, 3)
        stamp -= timedelta(hours=over)
        found.append(stamp.strftime(pattern)[:-3] + ("+01:00" if over else "+02:00") * offset)
    return found


def summer_time_ends() -> LabFile:
    """Return local times without offsets while the clock is set back (pandas-dev/pandas#29031)."""
    return LabFile(
        "a clock that is set back by an hour",
        {
            "a.csv": text(
                "time,pressure_kpa,angle_deg", *rows(_wall_clock("%Y-%m-%d %H:%M:%S.%f", False), KPA, DEG)
            )
        },
        named("a"),
        stated={"wrap": {"time": "1 h"}},
        refused=("set back by an hour", "wrap: {time: 1 h}"),
    )


def stamps_with_offsets() -> LabFile:
    """Return the same times with their offsets, which say all (pandas-dev/pandas#14585)."""
    return LabFile(
        "ISO times with two offsets",
        {
            "a.csv": text(
                "time,pressure_kpa,angle_deg", *rows(_wall_clock("%Y-%m-%dT%H:%M:%S.%f", True), KPA, DEG)
            )
        },
        named("a"),
    )


def dates_with_offsets() -> LabFile:
    """Return American dates with their offsets."""
    return LabFile(
        "American dates with two offsets",
        {
            "a.csv": text(
                "time,pressure_kpa,angle_deg", *rows(_wall_clock("%m/%d/%Y %H:%M:%S.%f", True), KPA, DEG)
            )
        },
        named("a"),
    )


def separator_line() -> LabFile:
    """Return a file whose first line tells a spreadsheet the separator (PowerShell/PowerShell#7776)."""
    german = rows(T, KPA, DEG, between=";", decimal=",")
    return LabFile(
        "a line sep=; above the header",
        {"a.csv": text("sep=;", "Zeit [s];Druck [kPa];Winkel [°]", *german)},
        named("a"),
    )


def _monitored(*lines: str) -> list[str]:
    """Return lines with the stamps that the Arduino IDE puts before them; the header has one too."""
    written = ["09:59:59.980", *(stamp[:12] for stamp in stamps("%H:%M:%S.%f"))]
    return [f"{stamp} -> {line}" for stamp, line in zip(written[-len(lines) :], lines, strict=True)]


def serial_monitor() -> LabFile:
    """Return the text of a serial monitor, with its time stamps (microsoft/vscode-arduino#1430)."""
    return LabFile(
        "a serial monitor with a header",
        {"a.txt": text(*_monitored("pressure_kpa,angle_deg", *rows(KPA, DEG)))},
        named("a"),
    )


def serial_monitor_without_a_header() -> LabFile:
    """Return the same text, the board having printed numbers alone."""
    return LabFile(
        "a serial monitor without a header",
        {"a.txt": text(*_monitored(*rows(KPA, DEG)))},
        refused=("the first row holds numbers", "header"),
    )


def serial_plotter() -> LabFile:
    """Return values behind their names, as the IDE's plotter takes them."""
    values = [f"pressure_kpa:{digits(p)}\tangle_deg:{digits(a)}" for p, a in zip(KPA, DEG, strict=True)]
    return LabFile("a serial plotter with time stamps", {"a.txt": text(*_monitored(*values))}, named("a"))


def monitor_and_board() -> LabFile:
    """Return a monitor's text whose rows have the board's own clock, which is nearer to the readings."""
    return LabFile(
        "a serial monitor, and the board's own clock",
        {"a.txt": text(*_monitored("millis,pressure_kpa,angle_deg", *rows(MS + 120, KPA, DEG)))},
        {"a": {**ONE["slow"], "time_s": T + 0.12}},
    )


def _two_sensors() -> list[str]:
    pairs = zip(T, KPA, DEG, strict=True)
    return [
        line
        for t, p, a in pairs
        for line in (f"{digits(t)},{digits(p)},", f"{digits(t + LATE_S)},,{digits(a)}")
    ]


def _interleaved(pressure_pa: np.ndarray, angle_rad: np.ndarray) -> Columns:
    """Return both sensors' rows; the last one lies beyond the pressure's span."""
    clock = np.column_stack([T, T + LATE_S]).ravel()
    angles = np.column_stack([np.full(SAMPLES, np.nan), angle_rad]).ravel()
    return {"time_s": clock[:-1], "pressure_pa": pressure_pa, "angle_rad": angles[:-1]}


def rows_of_two_sensors() -> LabFile:
    """Return two topics in one table, each with blanks in the rows of the other (PlotJuggler/PlotJuggler#1038)."""
    clock = np.column_stack([T, T + LATE_S]).ravel()
    lines = np.interp(clock[:-1], T, P)
    return LabFile(
        "a pressure and an angle in rows of their own",
        {"a.csv": text(HEAD, *_two_sensors())},
        {"a": _interleaved(lines, ONE["slow"]["angle_rad"])},
    )


def held_in_rows_of_its_own() -> LabFile:
    """Return a topic of commands that is written where it changes, beside readings."""
    changed = dict(zip(CHANGES_S, COMMANDS_KPA, strict=True))
    lines = [
        line
        for t, a in zip(T, DEG, strict=True)
        for line in (
            *([f"{digits(t)},{digits(changed[float(t)])},"] if float(t) in changed else []),
            f"{digits(t + LATE_S)},,{digits(a)}",
        )
    ]
    clock = np.array([float(line.partition(",")[0]) for line in lines])
    angles = np.array([float(line.rpartition(",")[2] or "nan") for line in lines])
    return LabFile(
        "commands in rows of their own, where they change",
        {"a.csv": text(HEAD, *lines)},
        {"a": {"time_s": clock, "pressure_pa": 1000 * _held(clock), "angle_rad": np.radians(angles)}},
        stated={"hold": {"pressure_kpa": True}},
        doubts=("pressure_kpa", "one straight line", "hold: {pressure_kpa: true}"),
    )


def _held(times: np.ndarray) -> np.ndarray:
    return np.array(COMMANDS_KPA)[np.searchsorted(CHANGES_S, times, side="right") - 1]


def log_of_changes() -> LabFile:
    """Return a logger that writes nothing but changes (DreamSourceLab/DSView#126), beside a camera."""
    return LabFile(
        "a logger that writes changes alone",
        {
            "valve.csv": text("time_s,pressure_kpa", *rows(CHANGES_S, COMMANDS_KPA)),
            "camera.csv": text("time_s,angle_deg", *rows(T, DEG)),
        },
        {"camera": {**ONE["slow"], "pressure_pa": 1000 * _held(T)}},
        stated={"join": {"file": "valve.csv", "hold": True}},
        refused=("join",),
    )


def multimeter() -> LabFile:
    """Return readings with their unit in a column beside them (N0ury/dmm_util#26)."""
    units = ["kPa"] * SAMPLES, ["deg"] * SAMPLES
    return LabFile(
        "columns of units with one name",
        {
            "a.tsv": text(
                "time_s\tPressure\tUnit\tAngle\tUnit", *rows(T, KPA, units[0], DEG, units[1], between="\t")
            )
        },
        named("a"),
    )


def units_without_a_name() -> LabFile:
    """Return the same with no name above the units."""
    units = ["kPa"] * SAMPLES, ["deg"] * SAMPLES
    return LabFile(
        "columns of units without a name",
        {"a.tsv": text("time_s\tPressure\t\tAngle\t", *rows(T, KPA, units[0], DEG, units[1], between="\t"))},
        named("a"),
    )


def stamps_in_two_columns() -> LabFile:
    """Return ROS stamps as seconds and nanoseconds (jmscslgroup/bagpy#21)."""
    seconds = [str(EPOCH_S + int(ms) // 1000) for ms in MS]
    nanoseconds = [str(int(ms) % 1000 * 1_000_000) for ms in MS]
    head = "header.stamp.sec,header.stamp.nanosec,header.frame_id,pressure_kpa,angle_deg"
    return LabFile(
        "seconds and nanoseconds",
        {"a.csv": text(head, *rows(seconds, nanoseconds, ["base"] * SAMPLES, KPA, DEG))},
        {"a": {**ONE["slow"], "time_s": EPOCH_S + T}},
    )


def clock_coarser_than_rows() -> LabFile:
    """Return a clock that stands still over several rows (msoon/PyMonsoon#37)."""
    return LabFile(
        "a clock coarser than the rows",
        {"a.csv": text(HEAD, *rows(np.floor(5 * T) / 5, KPA, DEG))},
        refused=("one sample has one time", "rate: 25 Hz"),
    )


def durations_in_words() -> LabFile:
    """Return durations with their unit in each cell, as MATLAB writes a timetable."""
    return LabFile(
        "durations with their unit in the cell",
        {"a.csv": text("Time,pressure_kpa,angle_deg", *rows([f"{digits(t)} sec" for t in T], KPA, DEG))},
        refused=("'0 sec' is neither a number nor a time", "time_s"),
    )


def overload_as_a_large_number() -> LabFile:
    """Return an overload that a multimeter writes as 9.99999999e+37 (N0ury/dmm_util#26)."""
    angles = [digits(a) for a in DEG]
    angles[20], angles[21] = "9.99999999e+37", "9.99999999E+37"
    missing = np.array([np.nan if k in (20, 21) else a for k, a in enumerate(ONE["slow"]["angle_rad"])])
    return LabFile(
        "an overload as a large number",
        {"a.csv": text(HEAD, *rows(T, KPA, angles))},
        {"a": {**part(*TPA)["slow"], "angle_rad": missing}},
        stated={"missing": ["9.99999999e+37"]},
        refused=("lines 22, 23", "beyond", 'missing: ["9.99999999e+37"]'),
    )


def asian_pressure() -> LabFile:
    """Return a pressure in kgf/cm2, as older gauges have it (WelSimLLC/WelSim-Apps#17)."""
    return LabFile(
        "a pressure in kgf/cm2",
        {"a.csv": text("Time [s],Pressure [kgf/cm2],Angle [deg]", *rows(T, KPA / 98.0665, DEG))},
        named("a"),
    )


def binary_files() -> list[LabFile]:
    """Return first bytes of loggers' binary files (adamreeve/npTDMS#198, and bags of ROS)."""
    return [
        LabFile("LabVIEW TDMS", {"a.tdms": b"TDSm\x0e\0\0\0\x69\x12" + bytes(200)}, refused=("TDMS", "CSV")),
        LabFile("a ROS bag", {"a.bag": b"#ROSBAG V2.0\n" + bytes(200)}, refused=("ROS bag", "rostopic")),
        LabFile("a ROS 2 bag", {"a.mcap": b"\x89MCAP0\r\n" + bytes(200)}, refused=("ROS 2", "CSV")),
        LabFile("a database", {"a.db3": b"SQLite format 3\0" + bytes(200)}, refused=("database", "CSV")),
        LabFile("a packed table", {"a.csv.gz": b"\x1f\x8b\x08\0" + bytes(200)}, refused=("gzip", "unpack")),
    ]


def changed_range() -> LabFile:
    """Return a multimeter's readings whose range, and with it their unit, changes."""
    units = ["kPa" if p < 10 else "mbar" for p in KPA]
    return LabFile(
        "a column of units that change",
        {"a.tsv": text("time_s\tPressure\tUnit\tangle_deg", *rows(T, KPA, units, DEG, between="\t"))},
        refused=("Pressure is in 'mbar' there, and in 'kPa' above",),
    )


def long_form() -> LabFile:
    """Return rows that name their quantity, as databases write them (theosysbio/means#2)."""
    lines = [
        f"{digits(t)},{name},{digits(v)}"
        for t, p, a in zip(T, KPA, DEG, strict=True)
        for name, v in (("pressure_kpa", p), ("angle_deg", a))
    ]
    return LabFile(
        "a table in long form",
        {"a.csv": text("time_s,sensor,value", *lines)},
        refused=(
            "'sensor' says what the 'value' of each row is (pressure_kpa, angle_deg)",
            "one column for each",
        ),
    )


def vacuum() -> LabFile:
    """Return a vacuum that counts downward, with the name as its only hint."""
    return LabFile(
        "a vacuum that is positive",
        {"a.csv": text("time_s,vacuum_kpa,angle_deg", *rows(T, KPA, DEG))},
        {"a": {**ONE["slow"], "pressure_pa": -P}},
        stated={"rename": {"vacuum_kpa": "pressure_pa"}, "units": {"vacuum_kpa": "-1 kPa"}},
        refused=('"vacuum_kpa": pressure_pa',),
    )
