"""How long fits to measured benches take: a ball joint under three pressures, a prismatic joint, a soft arm.

    python -m benchmarks.real.speed_of_fits [--improve] [--prepare FOLDER]

Prints seconds on the clock and of processor time, and writes benchmarks/out/speed_of_fits.json. Bars judge processor
time, for a fit uses one processor and others may be busy. The studies state rough laws: how long a fit takes is
measured, not how good the models are. `--improve` walks `pliant improve` of the soft arm on its seven recordings too,
in two processes. `--prepare` only writes the studies and tables to a folder.
"""

from __future__ import annotations

import csv
import resource
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from benchmarks.output import Bar, make_parser, write
from benchmarks.real.recordings import MEASURED, missing, write_rows

from pliant import api
from pliant.diagnosis.candidates import EffectSet
from pliant.diagnosis.effect_fit import EffectFit
from pliant.diagnosis.extension import Ground
from pliant.diagnosis.fitting import Fitter
from pliant.records.design import Array

PSI_PA = 6894.757
LINK_M = 0.065
MUSCLE_M = 0.029
FITTED = ("viscoelastic", "friction_hysteresis", "pressure_offset")
RELATED = "friction_hysteresis"  # whose relatives are fitted too: friction that falls with the rate
MOST_FIT_S, MOST_IMPROVE_S = 0.5, 180.0
CHAMBERS = ("pressure_1_pa", "pressure_2_pa", "pressure_3_pa")
LINK = ("three_bellow_link/drive_first_part.csv",)
MUSCLE = tuple(f"coiled_muscle/specimen_1_{grams}g.csv" for grams in (100, 300, 500))
ARM = tuple(
    f"soft_arm/{name}.csv" for name in (*(f"steps_{k}" for k in (1, 3, 5, 6, 8)), "tracking_1", "tracking_4")
)

# One ball joint whose axes have separate laws; each of three bellows bends it to its own side.
BALL = """
pliant: 1
name: {name}
surrogate:
  kind: polynomial
  axes:
    x: {{form: study, coefficients: {{k_n: 0, m_a: 0, m_e: 0, b_e: {twist}}}}}
    y: {{form: study, odd: true, coefficients: {{k_n: {gain}, m_a: 0, m_e: 0.02, b_e: {stiffness}}}}}
    z: {{form: study, odd: true, coefficients: {{k_n: 0, m_a: 0, m_e: 0.02, b_e: {stiffness}}}}}
chain:
  modules: {modules}
  module_length: {length} mm
  module_mass: {mass} g
  actuators:
    - {{input: pressure_1_pa}}
    - {{input: pressure_2_pa, rotation: 120 deg}}
    - {{input: pressure_3_pa, rotation: 240 deg}}
physics: quasistatic
measurements: {{file: recording.csv}}
"""
PRISMATIC = """
pliant: 1
name: coiled-muscle
surrogate:
  kind: polynomial
  form: study
  joint: prismatic
  coefficients: {k_n: -8.5e-7, m_a: 0, m_e: 0, b_e: 150}
chain: {modules: 1, module_length: 29 mm, module_mass: 2 g}
physics: quasistatic
measurements: {file: recording.csv}
"""


@dataclass(frozen=True)
class Seconds:
    """Seconds of one piece of work: on the clock, and of all processors."""

    wall: float
    processor: float

    @staticmethod
    def measure(work: Callable[[], object]) -> Seconds:
        """Time some work, its child processes included."""
        begun, used = time.perf_counter(), _processor_s()
        work()
        return Seconds(time.perf_counter() - begun, _processor_s() - used)


def _processor_s() -> float:
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(used.ru_utime + used.ru_stime for used in both)


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--improve", action="store_true", help="improve the soft arm as well")
    parser.add_argument("--prepare", type=Path, metavar="FOLDER", help="only write studies and tables")
    asked = parser.parse_args()
    if missing(*LINK, *MUSCLE, *ARM):
        return
    if asked.prepare:
        print(*prepare(asked.prepare).values(), sep="\n")
        return
    with tempfile.TemporaryDirectory() as folder:
        studies = prepare(Path(folder))
        times = {name: fits(study) for name, study in studies.items()}
        bars = [
            Bar(f"{name}: fit of {kind}", taken.processor, MOST_FIT_S, "s of processor")
            for name in ("link", "muscle")
            for kind, taken in times[name].items()
            if kind in FITTED
        ]
        if asked.improve:
            times["arm"]["improve"] = improve(studies["arm"])
            bars.append(Bar("arm: improve", times["arm"]["improve"].wall, MOST_IMPROVE_S, "s"))
    seconds = {name: {kind: asdict(taken) for kind, taken in one.items()} for name, one in times.items()}
    write("speed_of_fits", {"seconds": seconds}, bars)


def fits(study: Path) -> dict[str, Seconds]:
    """Return the seconds of the first prediction, with compilation, and of a fit of each effect."""
    opened = api.open_study(study, store=study.parent / "store")
    ground = Ground.from_study(opened.context, opened.study, api.read_measurement(opened))
    times = {"first prediction": Seconds.measure(ground.predictor.predict)}
    readings = ground.readings(())
    for kind, forms in (*((kind, ()) for kind in FITTED), (RELATED, (RELATED,))):
        found: list[EffectFit] = []
        label = f"{kind}, relatives" if forms else kind
        for name in (f"{label}, first", label):
            fitter = Fitter(ground.predictor, readings)
            candidate = EffectSet.from_kinds(opened.context.registry, (kind,), forms)
            times[name] = Seconds.measure(lambda: found.append(fitter.fit(candidate)))  # noqa: B023
        fit, samples = found[-1], sum(map(len, ground.measurement.runs))
        effects, finest = candidate.configs(fit.x), ground.predictor.refined(fit.parts)
        per_step = 1e6 / (samples * (1.5 * fit.parts if fit.parts > 1 else 1))
        once = Seconds.measure(lambda: finest.evaluate(effects))  # noqa: B023
        print(
            f"{opened.study.name}, {len(readings)} readings, {label}: {times[label].wall:.2f} s on the clock, "
            f"{times[label].processor:.2f} s of processor, the first time {times[f'{label}, first'].wall:.1f} s; "
            f"{fit.parts} steps a sample, {per_step * once.processor:.0f} µs a step, "
            f"{np.sqrt(fit.mean_square()):.2f} floors left",
            flush=True,
        )
    return times


def improve(study: Path) -> Seconds:
    """Return seconds of `pliant improve` in two processes."""
    opened = api.open_study(study, store=study.parent / "store")
    taken = Seconds.measure(lambda: print(api.improve(opened, workers=2).steps[-1].named))
    print(
        f"{opened.study.name}, improve: {taken.wall:.0f} s on the clock, {taken.processor:.0f} s of processor"
    )
    return taken


def prepare(folder: Path) -> dict[str, Path]:
    """Write the three studies with their recordings in SI; returns the studies by bench."""
    texts = {
        "link": BALL.format(name="link", modules=1, length=65, mass=17, gain=1e-6, stiffness=0.1, twist=0.2),
        "muscle": PRISMATIC,
        "arm": BALL.format(name="arm", modules=3, length=62, mass=40, gain=2e-5, stiffness=3.0, twist=6.0),
    }
    tables = {"link": link_rows(), "muscle": muscle_rows(), "arm": arm_rows()}
    studies = {}
    for name, text in texts.items():
        place = folder / name
        place.mkdir(parents=True, exist_ok=True)
        write_rows(place / "recording.csv", tables[name])
        studies[name] = place / "study.yaml"
        studies[name].write_text(text, encoding="utf-8")
    return studies


Rows = list[dict[str, object]]


def link_rows() -> Rows:
    """Return two curvatures as the tip position of one ball joint in the middle."""
    columns = _columns(LINK[0])
    bend = LINK_M * np.stack([columns["curvature_x_1_per_m"], columns["curvature_y_1_per_m"]])
    size = np.maximum(np.hypot(*bend), 1e-12)
    across = 0.5 * LINK_M * np.sin(size) * bend / size
    inputs = {name: columns[name] for name in CHAMBERS}
    return _rows("drive", columns["time_s"], inputs | {"tip_x_m": across[0], "tip_y_m": across[1]})


def muscle_rows() -> Rows:
    """Return three weights at one specimen; each recording relative to its first reading."""
    rows: Rows = []
    for name, grams in zip(MUSCLE, (100.0, 300.0, 500.0), strict=True):
        columns = _columns(name)
        time_s = columns["time_s"]
        moved = 1e-3 * (columns["displacement_mm"] - columns["displacement_mm"][0])
        own = {
            "pressure_pa": PSI_PA * columns["pressure_psi"],
            "payload_kg": np.full(len(time_s), 1e-3 * grams),
            "elongation_strain": (moved + 9.81e-3 * grams / 150.0) / MUSCLE_M,
        }
        rows += _rows(Path(name).stem, time_s, own)
    return rows


def arm_rows() -> Rows:
    """Return the tip's coordinates across the arm's axis: the camera's y in tracking runs, z in the others."""
    rows: Rows = []
    for name in ARM:
        columns = _columns(name)
        up = "tip_y_m" if "tracking" in name else "tip_z_m"
        side = "tip_z_m" if "tracking" in name else "tip_y_m"
        own = {chamber: PSI_PA * columns[f"pressure_{k}_psi"] for k, chamber in enumerate(CHAMBERS, start=1)}
        own |= {"tip_x_m": columns["tip_x_m"], "tip_y_m": columns[side], "tip_z_m": -columns[up]}
        own["payload_kg"] = np.full(len(columns["time_s"]), 0.2 if "tracking_4" in name else 0.0)
        rows += _rows(Path(name).stem, columns["time_s"], own)
    return rows


def _columns(name: str) -> dict[str, Array]:
    with (MEASURED / name).open(encoding="utf-8") as file:
        table: Iterable[Mapping[str, str]] = list(csv.DictReader(file))
    return {key: np.array([float(row[key] or "nan") for row in table]) for key in next(iter(table))}


def _rows(run: str, time_s: Array, columns: Mapping[str, Array]) -> Rows:
    return [
        {"run": run, "time_s": t, **{name: float(values[k]) for name, values in columns.items()}}
        for k, t in enumerate(time_s.tolist())
    ]


if __name__ == "__main__":
    main()
