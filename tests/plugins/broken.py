"""Packages that break in one way each, installed into a folder as by pip, and a study that names none of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

MANIFEST = """\
from pliant.registry.component import Component
from pliant.registry.hookspecs import hookimpl

CONTRACT = 3


@hookimpl
def pliant_components():
    return [Component("{interface}", "{name}", "{name}.config:Config", "{name}.work:Work", "a broken one")]
"""
EFFECT_CONFIG = """\
from typing import Literal
from pliant.interfaces.effect import EffectConfig, parameter


class Config(EffectConfig):
    kind: Literal["{name}"] = "{name}"
    share: float = parameter(unit="1", neutral=0.0, bounds=(0.0, 1.0), plausible=(0.1, 0.5))
"""
EFFECT = """\
from pliant.interfaces.effect import Effect
from pliant.records.term import LawTerm


class Work(Effect):
    place = "law"

    def apply(self, model):
        return model.with_term(LawTerm("actuation", factor, (self.config.share,)))


def factor(angle, rate, dt_s, actuation, temperature_c, old, new, parameters):
    return 1.0 - parameters[0]
"""
SURROGATE_CONFIG = """\
from typing import Literal
from pliant.interfaces.surrogate import SurrogateConfig


class Config(SurrogateConfig):
    kind: Literal["{name}"] = "{name}"
"""
SURROGATE = """\
from pliant.interfaces.surrogate import Surrogate


class Work(Surrogate):
    def fit(self, data):
        raise RuntimeError("no fit")

    def load(self, record):
        raise RuntimeError("no law")
"""
TERM = 'model.with_term(LawTerm("actuation", factor, (self.config.share,)))'
FACTOR = "    return 1.0 - parameters[0]"
# Name → file of the package, the original text, and its replacement.
EFFECT_WAYS: dict[str, tuple[str, str, str]] = {
    "manifest_raises": ("manifest.py", "CONTRACT = 3", "1 / 0"),
    "manifest_exits": ("manifest.py", "CONTRACT = 3", "import sys; sys.exit('no')"),
    "hook_returns_none": ("manifest.py", "    return [", "    ["),
    "config_not_there": ("manifest.py", ".config:Config", ".nowhere:Config"),
    "config_raises": ("config.py", "class Config", "1 / 0\n\n\nclass Config"),
    "config_exits": ("config.py", "class Config", "import sys; sys.exit(1)\n\n\nclass Config"),
    "config_declares_nonsense": ("config.py", "plausible=(0.1, 0.5)", "plausible=(0.1, 5.0)"),
    "config_undefined_annotation": ("config.py", "    share:", "    other: 'Nowhere' = None\n    share:"),
    "config_of_another_interface": ("config.py", "class Config(EffectConfig):", "class Config:"),
    "config_asks_for_more": ("config.py", "    share:", "    other: float\n    share:"),
    "work_raises": ("work.py", "class Work", "1 / 0\n\n\nclass Work"),
    "work_without_apply": ("work.py", "def apply", "def applied"),
    "constructor_raises": (
        "work.py",
        "    place",
        "    def __init__(self, config):\n        1 / 0\n\n    place",
    ),
    "unsuited_raises": (
        "work.py",
        "    def apply",
        "    def unsuited(self, chain, runs):\n        1 / 0\n\n    def apply",
    ),
    "unsuited_returns_none": (
        "work.py",
        "    def apply",
        "    def unsuited(self, *all):\n        pass\n\n    def apply",
    ),
    "apply_raises": ("work.py", TERM, "model.nothing"),
    "apply_returns_none": ("work.py", f"return {TERM}", "pass"),
    "term_without_role": ("work.py", '"actuation"', '"actuator"'),
    "term_raises": ("work.py", FACTOR, "    return new[0]"),
    "term_returns_none": ("work.py", FACTOR, "    pass"),
    "term_cannot_be_compiled": ("work.py", FACTOR, "    return float(str(1.0 - parameters[0]))"),
    "input_map_raises": ("work.py", TERM, "model.with_input(lambda history: history.nothing)"),
    "input_map_returns_none": ("work.py", TERM, "model.with_input(lambda history: None)"),
    "output_map_raises": ("work.py", TERM, "model.with_output(lambda readings: readings['nothing'])"),
    "output_map_returns_none": ("work.py", TERM, "model.with_output(lambda readings: None)"),
}
SURROGATE_WAYS: dict[str, tuple[str, str, str]] = {
    "law_config_raises": ("config.py", "class Config", "1 / 0\n\n\nclass Config"),
    "law_undefined_annotation": ("config.py", "    kind", "    other: 'Nowhere' = None\n    kind"),
    "law_work_raises": ("work.py", "class Work", "1 / 0\n\n\nclass Work"),
    "law_constructor_raises": (
        "work.py",
        "    def fit",
        "    def __init__(self, config):\n        1 / 0\n\n    def fit",
    ),
    "law_stated_raises": ("work.py", "    def fit", "    def stated(self):\n        1 / 0\n\n    def fit"),
    "law_fit_raises": ("work.py", "no fit", "no fit at all"),
    "law_fit_returns_none": ("work.py", '        raise RuntimeError("no fit")', "        pass"),
}
WAYS = (*EFFECT_WAYS, *SURROGATE_WAYS)
STUDY = """\
pliant: 1
name: joint
surrogate:
  kind: polynomial
  form: study
  odd: true
  coefficients: {k_n: 1.637e-6, m_a: -1.704e-6, b_a: 0, m_e: 0.1012, b_e: 0.0245}
chain: {modules: 1, module_length: 11 mm, gravity: [0, 0, 0]}
measurements: {file: joint.csv}
"""


def lay(folder: Path, way: str) -> str:
    """Write the package of a way and its `importlib.metadata` files; return its name, which is its kind too."""
    name = f"broken_{way}"
    effect = way in EFFECT_WAYS
    texts = {
        "manifest.py": MANIFEST.format(name=name, interface="effect" if effect else "surrogate"),
        "config.py": (EFFECT_CONFIG if effect else SURROGATE_CONFIG).format(name=name),
        "work.py": EFFECT if effect else SURROGATE,
        "__init__.py": "",
    }
    file, old, new = (EFFECT_WAYS | SURROGATE_WAYS)[way]
    assert texts[file].count(old) == 1 or file != "work.py", way
    texts[file] = texts[file].replace(old, new)
    lay_package(folder, name, texts)
    return name


def lay_package(folder: Path, name: str, texts: dict[str, str], version: str = "0.1") -> None:
    """Write a package and its metadata, as installed in `folder`."""
    (folder / name).mkdir(parents=True)
    for file, text in texts.items():
        (folder / name / file).write_text(text)
    info = folder / f"{name}-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    (info / "entry_points.txt").write_text(f"[pliant]\n{name} = {name}.manifest\n")


def write_study(folder: Path) -> Path:
    """Write a stated joint and a recording of one that takes 20 % less pressure, with 2 mrad of noise."""
    p = np.tile(np.linspace(0.0, 15e3, 13), 4)
    noise = np.random.default_rng(0).normal(0.0, 2e-3, len(p))
    k, a, m, b = 0.8 * 1.637e-6, 0.8 * -1.704e-6, 0.1012, 0.0245
    stiff = b - a * p
    u = (-stiff + np.sqrt(stiff**2 + 2 * m * k * p)) / m  # of m u²/2 + (b − a p) u = k p
    rows = [f"{1 + i // 13},{x:.6g},{y:.6g}" for i, (x, y) in enumerate(zip(p, u + noise, strict=True))]
    (folder / "joint.csv").write_text("\n".join(["run,pressure_pa,angle_rad", *rows, ""]))
    (folder / "joint.yaml").write_text(STUDY)
    return folder / "joint.yaml"


def write_table(file: Path) -> None:
    """Write states of one joint, τ = k p − (m u²/2 + b u), as a FEM from elsewhere gives them."""
    p, u = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 15e3, 5), np.linspace(0.0, 0.4, 6)))
    tau = 1.637e-6 * p - 0.1012 * u**2 / 2 - 0.0245 * u
    rows = [f"{a:.6g},{b:.6g},{t:.9g}" for a, b, t in zip(p, u, tau, strict=True)]
    file.write_text("\n".join(["pressure_pa,angle_rad,moment_n_m", *rows, ""]))
