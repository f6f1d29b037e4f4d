"""Mutants chosen by hand: former survivors, and places where a wrong sign, factor or lock is hard to detect."""

from __future__ import annotations

from tests.mutants.mutant import Mutant


def _at(room: str, file: str, before: str, after: str) -> Mutant:
    return Mutant(room, file, 0, before, after)


EVIDENCE, NOISE = "core/pliant/diagnosis/evidence_table.py", "core/pliant/diagnosis/noise.py"
EFFECTIVE = "core/pliant/measurements/effective.py"
STORE, DATASET = "core/pliant/store/store.py", "core/pliant/pipeline/dataset.py"
ROTATIONS, STATICS = "core/pliant/mechanics/rotations.py", "core/pliant/mechanics/statics.py"
KERNEL, JOBS = "plugins/pliant_plugins/fem/skfem/kernel.py", "core/pliant/execution/jobs.py"
EFFECTS = "plugins/pliant_plugins/effects"

CHOSEN: tuple[Mutant, ...] = (
    # Survivors of an earlier trial.
    _at("diagnosis", EVIDENCE, "unknown: float = 30.0", "unknown: float = 0.0"),
    _at("diagnosis", EVIDENCE, "UNSEEN_RISE = 1.03", "UNSEEN_RISE = 1.3"),
    _at("diagnosis", NOISE, "floor.between * max(1.0 - standard_error, 0.0) /", "floor.between /"),
    _at("diagnosis", EFFECTIVE, " * np.sqrt(len(rows) / (len(rows) - 1))", ""),
    _at("fem", KERNEL, "(twice / 9 - 2 / 3 * m)", "(twice / 9 - m)"),
    # Thresholds and prices of the diagnosis.
    _at("diagnosis", EVIDENCE, "effect: float = 2.1", "effect: float = 0.0"),
    _at("diagnosis", EVIDENCE, "accepted: float = 0.9", "accepted: float = 0.5"),
    _at("diagnosis", EVIDENCE, "between_run_scatter: float = 1.5", "between_run_scatter: float = 15.0"),
    _at("diagnosis", EVIDENCE, "0.5 * row.n_parameters * np.log(n)", "row.n_parameters * np.log(n)"),
    # Mechanics: signs and factors.
    _at(
        "physics",
        ROTATIONS,
        "closed = (1.0 - 0.5 * t / np.tan(0.5 * t)) / t**2",
        "closed = (1.0 - t / np.tan(0.5 * t)) / t**2",
    ),
    _at("physics", ROTATIONS, "0.5 * skew(phi) + d", "-0.5 * skew(phi) + d"),
    _at(
        "physics",
        STATICS,
        "self._mass[:, None] * loads.gravity_m_s2",
        "-self._mass[:, None] * loads.gravity_m_s2",
    ),
    _at("fem", KERNEL, "m += P[i] * f[i] / 3", "m += P[i] * f[i] / 2"),
    # Effects.
    _at(
        "effects",
        f"{EFFECTS}/viscous_damping.py",
        "return -c[0] * rate\n",
        "return c[0] * rate\n",
    ),
    _at("effects", f"{EFFECTS}/viscoelastic.py", "-math.expm1(-steps) / steps", "math.exp(-steps)"),
    _at(
        "effects",
        f"{EFFECTS}/viscoelastic.py",
        "self.config.share * rest_stiffness",
        "2.0 * self.config.share * rest_stiffness",
    ),
    # The store and its guarantees.
    _at("store", STORE, "lock.acquire(timeout=0.2)", "pass"),
    _at("store", STORE, "if digest != expected[name]:", "if False:"),
    _at("store", STORE, "temporary.replace(folder)", "shutil.copytree(temporary, folder)"),
    _at("store", DATASET, "AGREEMENT = 1e-6", "AGREEMENT = 1e6"),
    # A dying worker.
    _at("execution", JOBS, "MOST_TRIES = 2", "MOST_TRIES = 200"),
    _at("execution", JOBS, "self._alone = True", "self._alone = False"),
)
