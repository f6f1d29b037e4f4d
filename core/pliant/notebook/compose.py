"""Studies composed in Python: blocks become a study file in the store, with which every command works.

data = pliant.solve(BellowBendingConfig(...), NeoHookeanConfig(shear_modulus="240 kPa"), pressure_max="15 kPa")
law = pliant.fit(data)
chain = pliant.Chain.from_modules(law, 8, payload="13 g")
chain.settle(pressure="15 kPa", engine="mujoco").tip
pliant.diagnose(chain, pliant.read("bench.csv")).to_frame()
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from pliant import api
from pliant.config.paths import change_paths
from pliant.config.writing import yaml_writer
from pliant.errors import UserError
from pliant.interfaces.base import FrozenModel
from pliant.notebook.result import Result, Simulated
from pliant.notebook.study import Data, Fitted, Solved, StudyHandle
from pliant.store.store import write_atomically

# A typed config, its keys as a study writes them, or the kind alone.
Block: TypeAlias = FrozenModel | Mapping[str, Any] | str
Number: TypeAlias = float | str  # SI, or with a unit: "15 kPa"


class ComposedStudy(StudyHandle):
    """A study of blocks instead of a file; `path` is its file in the store.

    >>> task = {"kind": "free_bending", "pressure": "15 kPa"}
    >>> modules = {"modules": 8, "module_length": "11 mm", "gravity": [0, 0, 0]}
    >>> pliant.Study("finger", surrogate=LAW, chain=modules, task=task, store=store).simulate().tip.round(3)
    array([ 0.059,  0.   , -0.008])
    """

    def __init__(
        self,
        name: str = "study",
        *,
        plugins: Sequence[str | Path] = (),
        model: Block | None = None,
        family: Block | None = None,
        material: Block | None = None,
        fem: Block | None = None,
        surrogate: Block | None = None,
        meta_model: Block | None = None,
        law_error: Number | None = None,
        chain: Block | None = None,
        physics: Block | None = None,
        cross_check: Sequence[Block] = (),
        task: Block | None = None,
        effects: Sequence[Block] = (),
        posterior: Block | None = None,
        measurements: Block | Path | None = None,
        sweep: Block | None = None,
        search: Block | None = None,
        optimizer: Block | None = None,
        bench: Block | None = None,
        experiment: Block | None = None,
        printer: Block | None = None,
        solid: Block | None = None,
        mould: Block | None = None,
        uncertainty: Block | None = None,
        noise: Block | None = None,
        protocols: Sequence[Block] = (),
        workers: Block | int | None = None,
        store: str | Path = api.DEFAULT_STORE,
    ) -> None:
        """Compose a study; the arguments are the keys of a study file.

        Raises:
            UserError: a block is missing or wrong; the message lists every problem.
        """
        blocks = {key: value for key, value in locals().items() if key not in ("self", "store", "__class__")}
        path = _written(blocks, Path(store))
        super().__init__(path, (), api.open_study(path, store=store))


class Chain(ComposedStudy):
    """Modules of one law in a row, with their payload and base.

    >>> chain = pliant.Chain.from_modules(LAW, 8, module_length="11 mm", store=store)
    >>> chain.with_(payload="13 g").settle(pressure="15 kPa").tip.round(3)
    array([ 0.061,  0.   , -0.029])
    """

    @classmethod
    def from_modules(
        cls,
        law: Fitted | Block,
        modules: int,
        *,
        module_length: Number | None = None,
        module_mass: Number | None = None,
        payload: Number | None = None,
        gravity: Sequence[float] | None = None,
        base: Block | None = None,
        effects: Sequence[Block] = (),
        name: str = "chain",
        store: str | Path = api.DEFAULT_STORE,
    ) -> Chain:
        """Return a chain of equal modules.

        Args:
            law: what `fit` gave, or the block of a surrogate whose numbers are stated.
            modules: their number.
            module_length, module_mass: of a law without a family.
            payload: mass at the tip.
            gravity: (3,) in the world, m/s².
            base: pose of the first module.
            effects: what acts beside the law, in this order.
            name: of the study.
            store: folder of cached results.

        Raises:
            UserError: a length is missing, or stated although the law's family has one.

        >>> pliant.Chain.from_modules(LAW, 8, module_length="11 mm", store=store).settle(pressure="15 kPa").tip.round(3)
        array([ 0.059,  0.   , -0.008])
        """
        keys = {
            "modules": modules,
            "module_length": module_length,
            "module_mass": module_mass,
            "payload": payload,
            "gravity": None if gravity is None else list(gravity),
            "base": base,
        }
        chain = {key: value for key, value in keys.items() if value is not None}
        return cls(name, chain=chain, effects=effects, store=store, **_law_blocks(law))

    def settle(
        self,
        *,
        pressure: Number | None = None,
        tendon_force: Number | None = None,
        inputs: Mapping[str, float] | None = None,
        engine: Block = "quasistatic",
    ) -> Simulated:
        """Return the equilibrium under these inputs, which are raised from zero in steps.

        Args:
            pressure: of the chamber, or of the first of several.
            tendon_force: of the tendon, or of the first of several.
            inputs: every input by its name, SI, instead.
            engine: the physics backend.

        Raises:
            UserError: the chain has no such input, or the engine cannot simulate it.

        >>> round(float(chain.settle(pressure="10 kPa", engine="mujoco").tip[2]), 3)
        -0.027
        """
        drive = {"pressure": pressure, "tendon_force": tendon_force, "inputs": inputs}
        stated = {key: value for key, value in drive.items() if value is not None}
        if len(stated) != 1:
            raise UserError("settle needs one of 'pressure', 'tendon_force' and 'inputs'.")
        return self.with_(task={"kind": "free_bending", **stated}, physics=_plain(engine)).simulate()


def solve(
    family: Block,
    material: Block | None = None,
    fem: Block | None = None,
    *,
    pressure_max: Number | None = None,
    name: str = "module",
    store: str | Path = api.DEFAULT_STORE,
) -> Solved:
    """Solve one module by FEM; the record is a `ModuleData`, and `fit` takes the result.

    Args:
        family: the actuator and its design.
        material: what it is made of.
        fem: the backend and the states; its defaults without it.
        pressure_max: the largest pressure, instead of that of `fem`.
        name: of the study.
        store: folder of cached results.

    Raises:
        UserError: an impossible design or block.
        NotReachedError: no equilibrium was found.

    >>> few = {"kind": "skfem", "pressures": 3, "angles": 3, "check_states": 2}
    >>> rubber = {"kind": "neo_hookean", "shear_modulus": "240 kPa"}
    >>> len(pliant.solve(FINGER, rubber, few, pressure_max="15 kPa", store=store).to_frame()) > 4
    True
    """
    block = dict(_plain({"kind": "skfem"} if fem is None else fem))
    if pressure_max is not None:
        block = {key: value for key, value in block.items() if key not in ("pressure_max", "pressure_max_pa")}
        block["pressure_max"] = pressure_max
    return ComposedStudy(name, family=family, material=material, fem=block, store=store).fem()


def compare(model: StudyHandle, data: Data = None) -> Result[Any]:
    """Compare a model with measurements; the record is a `Comparison`.

    >>> round(pliant.compare(joint).rmse_over_floor, 1)
    2.5
    """
    return model.compare(data)


def diagnose(model: StudyHandle, data: Data = None, *, effects: Sequence[str] | None = None) -> Result[Any]:
    """Find which physical effect a model lacks; the record is a `Diagnosis`.

    >>> pliant.diagnose(joint, effects=["viscoelastic", "stiffness"]).verdict
    'missing_effect'
    """
    return model.diagnose(data, effects=effects)


def improve(model: StudyHandle, data: Data = None, *, effects: Sequence[str] | None = None) -> Result[Any]:
    """Add effects to a model until the noise floor; the record is an `Improvement`.

    >>> pliant.improve(joint, effects=["viscoelastic", "stiffness"]).to_frame()["added"].tolist()
    ['the model as it was', 'viscoelastic']
    """
    return model.improve(data, effects=effects)


def _law_blocks(law: Fitted | Block) -> dict[str, Any]:
    """Return the blocks of a study that give a law; those of its own study where it has one."""
    if not isinstance(law, Fitted):
        return {"surrogate": law}
    if law.study is None:  # of a table
        return {"surrogate": law.record[0].design.surrogate}
    config = law.study.config
    keys = ("family", "material", "fem", "surrogate", "meta_model", "law_error", "sweep")
    return {key: value for key in keys if (value := getattr(config, key)) is not None}


def _written(blocks: Mapping[str, Any], store: Path) -> Path:
    """Write the blocks as a study file into the store, named by its content."""
    stated = {key: _plain(value) for key, value in blocks.items() if value is not None and value != ()}
    change_paths(stated, lambda path: str(Path(path).resolve()))
    stream = io.StringIO()
    yaml_writer().dump({"pliant": 1, **stated}, stream)
    text = stream.getvalue()
    path = store / "studies" / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        write_atomically(path, text)
    return path.resolve()


def _plain(value: Any) -> Any:
    """Return a block as a study file holds it; files by their absolute paths."""
    if isinstance(value, FrozenModel):
        return value.canonical()
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return value
