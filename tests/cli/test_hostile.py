"""Hostile tables, names and disks give a sentence, are shown literally, and leave no half-written file."""

import os
import resource
from pathlib import Path

import numpy as np
import pytest
from tests.evidence.test_compare_verb import STUDY, bench_csv
from tests.slow import slow_among

from pliant.errors import UserError
from pliant.report.chart import Chart, ChartAxis, ChartLine, Panel
from pliant.report.document import Document
from pliant.report.figures import style
from pliant.report.render import page
from pliant.report.stage import write_page
from pliant.report.still import drawn
from pliant.user_text import escape_controls

ESC = "\x1b[31m\x07\x9b"
COLUMNS = ["time_s", "pressure_pa", "moment_n_m", "angle_rad"]


@pytest.fixture
def bench(workplace):
    """Write the study and its table with each value of a column changed."""

    def written(column="", change=lambda value: value, run=str):
        head, *rows = (line.split(",") for line in bench_csv(repeats=1).splitlines())
        for row in rows:
            row[0] = run(row[0])
            for k, name in enumerate(head):
                row[k] = repr(change(float(row[k]))) if name == column else row[k]
        Path("bench.csv").write_text("\n".join(",".join(row) for row in [head, *rows]) + "\n")
        Path("study.yaml").write_text(STUDY)
        return "study.yaml"

    return written


@pytest.mark.parametrize(
    ("column", "change"),
    [
        ("angle_rad", lambda angle: angle * 1e150),
        ("angle_rad", lambda angle: 1e308 if angle > 0.1 else angle),
        ("pressure_pa", lambda pressure: pressure * 1e200),
        ("moment_n_m", lambda moment: -1e308),
        ("time_s", lambda time: time * 1e60),
    ],
)
def test_a_number_beyond_any_quantity_is_named_with_its_line(bench, pliant, column, change):
    pliant("compare", bench(column, change)).refused("line", f"column {column} is beyond ±1e+30")


@pytest.mark.parametrize("factor", slow_among([1e-300, 1e-320], 1e-300))
def test_a_number_that_is_almost_none_is_none(bench, pliant, factor):
    call = pliant("compare", bench("pressure_pa", lambda pressure: pressure * factor))
    assert call.code in (0, 2, 3) and "Traceback" not in call.err


def test_slopes_and_states_beyond_any_quantity_are_no_fem_table(workplace, pliant):
    rows = "\n".join(f"{p},{u},-1e308" for p in (0, 5e3, 1e4) for u in (0.0, 0.1, 0.2))
    Path("t.csv").write_text(f"pressure_pa,angle_rad,moment_n_m\n{rows}\n")
    Path("study.yaml").write_text("pliant: 1\nname: t\nsurrogate: {kind: polynomial, data: t.csv}\n")
    pliant("fit", "study.yaml").refused("beyond")


# Of the two runs of a study.
NAMES = [
    ("$\\frac{$", f"a{ESC}b"),
    ("$a_$", "<b>&amp;"),
    ("${}$ $^_$", "_hidden"),
    ("[red]x[/]", "_hidden"),
]


@pytest.mark.parametrize("names", slow_among(NAMES, *NAMES[1:]))
def test_a_name_is_shown_as_it_is_everywhere(bench, pliant, names):
    study = bench(run=lambda run: f"{names[run.startswith('M2')]}{run}")
    call = pliant("compare", study, "--out", "out").done()
    html = Path("out/report.html").read_text(encoding="utf-8")
    assert not set("\x1b\x07\x9b") & set(call.out + call.err + html)
    assert "<b>&amp;" not in html and ("<b>&amp;" not in names or "&lt;b&gt;&amp;amp;" in html)
    assert len(list(Path("out/pictures").glob("*.png"))) > 0


@pytest.mark.pixels
def test_a_still_shows_dollars_as_they_are():
    x = ChartAxis("$a_$", ends=(1e-3, 1e3), log=True)
    line = ChartLine("$b$", np.array([1.0]), np.array([1.0]))
    with drawn(Chart((Panel(x, ChartAxis("effort τ", "N"), (line,), "$c$"),))) as figure:
        (axes,) = figure.axes
        assert style.png(figure).size > 1000
        assert not axes.title.get_parse_math() and axes.get_xlabel() == "$a_$"
        assert not any("$" in label.get_text() for label in axes.get_xticklabels())


def test_control_codes_become_visible():
    assert escape_controls(f"a{ESC}\tb\n") == "a�[31m��\tb\n"
    assert "\x1b" not in page(Document(kind="k", title=f"t{ESC}", sentence=ESC, data={}, brief=())).html


@pytest.fixture
def full_disk():
    """Limit files to 4 kB, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("large", ["page", "picture"])
def test_a_full_disk_leaves_the_earlier_page_whole_and_nothing_else(tmp_path, full_disk, large):
    small = np.frombuffer(b"png", np.uint8)
    write_page(tmp_path, "earlier", {"runs": small})
    html = "x" * (100_000 if large == "page" else 10)
    pictures = {
        "runs": np.frombuffer(b"new", np.uint8),
        "where": np.zeros(10 if large == "page" else 100_000, np.uint8),
    }
    with pytest.raises(UserError, match="cannot be written"):
        write_page(tmp_path, html, pictures)
    files = {p.relative_to(tmp_path).as_posix(): p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    assert files == {"report.html": b"earlier", "pictures/runs.png": b"png"}


def test_pipes_and_devices_are_no_tables(bench, pliant):
    os.mkfifo("pipe.csv")
    for name in ("pipe.csv", "/dev/zero"):
        pliant("compare", bench(), "--data", name).refused("it is a device or a pipe")
