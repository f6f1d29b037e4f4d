"""Prediction of a study's chain for measured runs: the same histories, the same readings."""

from __future__ import annotations

import copy
import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pliant.config.study import Study
from pliant.errors import UserError
from pliant.evidence.alignment import Alignment, Turns, components
from pliant.evidence.measured_model import MeasuredModel, Prediction, RunReadings, differences
from pliant.evidence.release import first_bend, released
from pliant.interfaces.effect import Effect, EffectConfig, Model
from pliant.interfaces.model import Channel
from pliant.interfaces.physics import PhysicsBackend, Variation
from pliant.measurements.beginnings import prepend_ramp, with_known_states
from pliant.mechanics.kinematics import ChainGeometry, base_rotations, orientations, trajectory
from pliant.mechanics.prescribed import BLOCKED, blocked_efforts, is_held, prescribed_motion, without_held
from pliant.pipeline.engine_checks import check_capabilities, check_terms, require_histories
from pliant.pipeline.study import build_study_chain, study_physics
from pliant.pipeline.workbench import RunContext
from pliant.records.chain import ChainModel
from pliant.records.design import Array
from pliant.records.history import Followed, History, held, run_by_run
from pliant.records.measurement import Measurement
from pliant.units import si_unit

JOINT_ANGLE = re.compile(r"joint_(\d+)_angle(?:_([yz]))?_rad")
# Of the whole chain: the sum of its joints' coordinates about one axis, over its length for curvatures.
BEND = re.compile(r"(angle|curvature)(?:_([yz]))?_(?:rad|1_per_m)")
TRAVELS = ("elongation_strain", "extension_m")
POSITION = re.compile(r"(tip|marker_(\d+))_([xyz])_m")
# Noise of an output that was not measured: at least this angle, or this share of the chain's length.
LEAST_ANGLE_RAD, LEAST_OF_LENGTH = 0.002, 0.001
# A marker may be stated to be outside the chain by this share of its length.
BEYOND = 0.05
# The integration is fine enough if twice as many steps change an output by less than this share of its range.
CLOSE = 5e-4
# Maximum number of steps from sample to sample, and in all runs together.
MOST_PARTS, MOST_STEPS = 16, 400_000
# Maximum number of parts of a step where joints have several coordinates: such a step costs ten times as much.
MOST_PARTS_SPATIAL = 4


class Predictor(MeasuredModel):
    """A chain in an engine, driven by the histories of a measurement.

    The study's own effects are part of the model; `predict` and `vary` add further ones. `law_error` is the error of
    the laws that the study states, as a share of the torque range.
    """

    def __init__(
        self,
        context: RunContext,
        backend: PhysicsBackend,
        chain: ChainModel,
        measurement: Measurement,
        effects: Sequence[EffectConfig] = (),
        law_error: float | None = None,
    ) -> None:
        self.context, self.backend, self.measurement = context, backend, measurement
        self.law_error = law_error
        self.effects = tuple(effects)
        self._base = self._changed(Model(chain), effects)
        self._geometry = ChainGeometry.from_chain(self._base.chain)
        self.parts = 1
        self._histories = prepend_ramp([run.history for run in measurement.runs])
        self._alignment = Alignment.from_measurement(measurement)
        self._turns: tuple[Turns, ...] | None = None
        self._finer: dict[int, Sequence[History]] = {}
        length = float(self._arms()[-1])
        for number, arm in enumerate(measurement.marker_arms_m, start=1):
            if not -BEYOND * length <= arm <= (1.0 + BEYOND) * length:
                raise UserError(
                    f"{measurement.source}: marker {number} is said to sit {arm:g} m along a chain that is "
                    f"{length:g} m long; give 'markers' from the base on, in the order of their numbers."
                )
        if sentence := backend.preparing(chain):
            context.progress.note(sentence)
        self.outputs, self.missing = self._readable(measurement.outputs)
        if not self.outputs:
            angles = ["angle_rad", "curvature_1_per_m", "joint_1_angle_rad…"]
            if self._geometry.turns and len(self._geometry.axes) > 1:
                angles += ["angle_y_rad, angle_z_rad", "curvature_y_1_per_m, curvature_z_1_per_m"]
            offered = [*TRAVELS] if self._geometry.kind == "prismatic" else angles
            offered += ["tip_x_m, tip_y_m, tip_z_m", "marker_1_x_m…"]
            raise UserError(
                f"{measurement.source}: the model has none of the measured outputs "
                f"({', '.join(measurement.outputs) or 'no output column'}); a chain of {chain.n_joints} "
                f"{chain.laws[0].joint} joints has {', '.join(offered)}."
            )

    @staticmethod
    def from_study(context: RunContext, study: Study, measurement: Measurement) -> Predictor:
        """Return the predictor of the study's chain, engine and effects.

        Raises:
            UserError: an engine that cannot simulate histories, or no output that the model has.
        """
        physics = study_physics(context, study)
        backend: PhysicsBackend = context.build("physics", physics)
        require_histories(backend)
        chain = build_study_chain(context, study).chain
        check_capabilities(backend, chain, physics.kind)
        return Predictor(context, backend, chain, measurement, study.effects, study.law_error)

    def for_runs(self, measurement: Measurement) -> Predictor:
        """Return the same model, driven by other runs.

        They may have other outputs; those that the model lacks are omitted.
        """
        other = copy.copy(self)
        other.measurement, other.parts = measurement, 1
        other._histories = prepend_ramp([run.history for run in measurement.runs])
        other._alignment = Alignment.from_measurement(measurement)
        if not other._alignment.has_readings:
            other._alignment = self._alignment.frozen(self.turns, measurement)
        other.outputs, other.missing = other._readable(measurement.outputs)
        return other

    def with_engine(self, backend: PhysicsBackend) -> Predictor:
        """Return the same model in another engine."""
        other = copy.copy(self)
        other.backend = backend
        return other

    def changed(self, change: Callable[[Model], Model]) -> Predictor:
        """Return the same runs with another model; the study's effects are retained."""
        other = copy.copy(self)
        other._base = change(self._base)
        other._geometry = ChainGeometry.from_chain(other._base.chain)
        return other

    def refined(self, parts: int) -> Predictor:
        """Return the same model, integrated in `parts` steps from each sample to the next, 1 or an even number.

        The implicit step of the engines has a first-order error in its length. Twice the finer path minus the coarser
        one is of second order (Richardson, Phil. Trans. R. Soc. A 226, 1927).
        """
        if parts == self.parts:
            return self
        other = copy.copy(self)
        other.parts, other._finer = parts, self._finer
        return other

    def steps_between_samples(
        self,
        effects: Sequence[EffectConfig] = (),
        least: int = 1,
        close: Mapping[str, float] | None = None,
    ) -> int:
        """Return the steps from sample to sample, doubled from `least` until doubling hardly changes the outputs.

        Dynamics faster than the sampling need more of them; models without memory or clock need one. `close`: the
        negligible change of each output, root mean square in its unit; a share of its range by default.
        """
        timed = sum(len(history) for history in self._histories if history.time_s is not None)
        model = self._changed(self._base, effects)
        moves = model.inputs or model.outputs or any(term.needs_time for term in model.chain.terms)
        if not timed or not moves or self.backend.capabilities.dynamic or _fitting_parts(model, 2) == 1:
            return least
        known: dict[int, tuple[RunReadings, ...]] = {}  # each is the coarser one of the next
        parts, here = least, self._second_order(model, least, known)
        measured = [run.outputs for run in self.measurement.runs]
        ranges = {name: max(_range(measured, name), _range(here, name)) for name in self.outputs}
        allowed = {name: CLOSE * span for name, span in ranges.items()} | dict(close or {})
        most = MOST_PARTS if len(self.chain.axes) == 1 else MOST_PARTS_SPATIAL
        while parts < most and 2 * parts * timed <= MOST_STEPS:
            finer = self._second_order(model, 2 * parts, known)
            if all(_change(here, finer, name) <= allowed[name] for name in self.outputs):
                break
            parts, here = 2 * parts, finer
        return parts

    @property
    def chain(self) -> ChainModel:
        """Return the chain with the study's effects."""
        return self._base.chain

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """Return the chain's actuations."""
        names = dict.fromkeys(actuator.input for actuator in self.chain.actuators)
        return tuple(Channel(name, si_unit(name)) for name in names)

    @property
    def threads(self) -> bool:
        """Return whether the engine works in several threads."""
        return self.backend.capabilities.threads

    @property
    def has_derivatives(self) -> bool:
        """Return true: engines carry derivatives along."""
        return True

    @property
    def modules(self) -> tuple[str, ...]:
        """Return the module of the engine."""
        return (type(self.backend).__module__,)

    @property
    def spatial(self) -> bool:
        """Return whether joints have several coordinates."""
        return len(self.chain.axes) > 1

    def with_known_states(self) -> tuple[Measurement, tuple[str, ...]]:
        """Return the measurement without the first seconds of runs that begin in motion, and a sentence about them."""
        return with_known_states(self.measurement)

    def unsuited(self, effect: Effect) -> str:
        """Return why these runs cannot show an effect on this chain; "" if they can."""
        return effect.unsuited(self.chain, [run.history for run in self.measurement.runs])

    @property
    def is_conditioned(self) -> bool:
        """Return true: rubber remembers its first load."""
        return True

    def least_noise(self, output: str) -> float:
        """Return the smallest noise of an output that was not measured: a share of the length, or of an angle."""
        return LEAST_OF_LENGTH * self.chain.length_m if POSITION.fullmatch(output) else LEAST_ANGLE_RAD

    @property
    def main_axis(self) -> int:
        """Return the index of a joint's main coordinate."""
        return self._geometry.main

    @property
    def remarks(self) -> list[str]:
        """Return sentences on measured outputs that the model lacks, and on fitted quantities of the sensors."""
        said = [f"The model has no {', '.join(self.missing)}: left out."] if self.missing else []
        return said if self._alignment.idle else [*said, *self._alignment.sentences(self.turns)]

    @property
    def turns(self) -> tuple[Turns, ...]:
        """Return the rotations of the sensors' frames that best fit the study's own model, by session."""
        if self._turns is None:
            sessions = self._alignment.sessions
            estimated = any(session.fixed is None for session in sessions)
            self._turns = self._alignment.turns(
                self.unaligned() if estimated else [{}] * len(self._histories)
            )
        return self._turns

    def unaligned(self) -> tuple[RunReadings, ...]:
        """Return predictions of the study's own model in the frames of the world and the module."""
        model = self._changed(self._base, ())
        driven = self._reached(model, self._histories)
        paths, _ = require_histories(self.backend).follow(model.chain, driven)
        return self._unturned(model, paths, driven, 1)

    @property
    def no_state(self) -> str:
        """Return the sentence on a model that reaches none of the measured states."""
        return "the model has no equilibrium in any of the measured states"

    def evaluate(
        self, effects: Sequence[EffectConfig] = (), histories: Sequence[History] | None = None
    ) -> Prediction:
        """Return the prediction, for `histories` instead of the measured ones if they are given."""
        self.heed()
        driven = self._histories if histories is None else list(histories)
        model = self._changed(self._base, effects)
        parts = _fitting_parts(model, self.parts)
        found = self._evaluate(model, driven, parts)
        if parts == 1:
            return found
        coarser = self._evaluate(model, driven, parts // 2)
        return Prediction(_extrapolated(found.runs, coarser.runs), found.n_failed)

    def _second_order(
        self, model: Model, parts: int, known: dict[int, tuple[RunReadings, ...]]
    ) -> tuple[RunReadings, ...]:
        """Return the measured runs as `evaluate` does; predictions of first order are taken from `known`, or added."""
        for count in (parts, max(parts // 2, 1)):
            if count not in known:
                self.heed()
                known[count] = self._evaluate(model, self._histories, count).runs
        return known[1] if parts == 1 else _extrapolated(known[parts], known[parts // 2])

    def _evaluate(self, model: Model, driven: Sequence[History], parts: int) -> Prediction:
        if any(map(is_held, driven)):
            return self._held(model, driven, parts)
        reached = self._reached(model, self._fine(driven, parts))
        paths, _ = require_histories(self.backend).follow(model.chain, reached)
        failed = int(sum((~path.converged).sum() for path in paths))
        own = driven is self._histories
        return Prediction(self._read(model, paths, reached, parts, own=own), failed)

    def paths(self, effects: Sequence[EffectConfig] = ()) -> tuple[tuple[History, ...], tuple[Followed, ...]]:
        """Return per run the history after the effects' input maps, and the chain's path under it."""
        model = self._changed(self._base, effects)
        reached = tuple(self._reached(model, self._histories))
        return reached, require_histories(self.backend).follow(model.chain, reached)[0]

    def vary(
        self, effects: Sequence[EffectConfig], towards: Sequence[Sequence[EffectConfig]]
    ) -> tuple[Prediction, tuple[tuple[RunReadings, ...], ...]]:
        """Return the prediction, and its first-order changes under small changes of the effects' parameters."""
        self.heed()
        models = [self._changed(self._base, changed) for changed in (effects, *towards)]
        parts = _fitting_parts(models[0], self.parts)
        found, moves = self._vary(models, parts)
        if parts == 1:
            return found, moves
        coarser, others = self._vary(models, parts // 2)
        runs = _extrapolated(found.runs, coarser.runs)
        pairs = zip(moves, others, strict=True)
        return Prediction(runs, found.n_failed), tuple(_extrapolated(fine, coarse) for fine, coarse in pairs)

    def _vary(
        self, models: Sequence[Model], parts: int
    ) -> tuple[Prediction, tuple[tuple[RunReadings, ...], ...]]:
        """Return the prediction of the first model, and its differences to each of the others."""
        model, *others = models
        if any(map(is_held, self._histories)):
            kept = self._held(model, self._histories, parts)
            moved_runs = [self._held(other, self._histories, parts).runs for other in others]
            return kept, tuple(differences(kept.runs, there) for there in moved_runs)
        fine = self._fine(self._histories, parts)
        driven = tuple(self._reached(model, fine))
        if others and all(m.chain is model.chain and m.inputs == model.inputs for m in others):
            paths, _ = require_histories(self.backend).follow(model.chain, driven)  # only the sensors differ
            base = self._read(model, paths, driven, parts)
            failed = int(sum((~path.converged).sum() for path in paths))
            seen = (self._read(other, paths, driven, parts) for other in others)
            return Prediction(base, failed), tuple(differences(base, there) for there in seen)
        variations = [Variation(m.chain, tuple(self._reached(m, fine))) for m in others]
        paths, changes = require_histories(self.backend).follow(model.chain, driven, variations)
        base = self._read(model, paths, driven, parts)
        moves: list[tuple[RunReadings, ...]] = []
        for other, change, variation in zip(others, changes, variations, strict=True):
            pairs = zip(paths, change, strict=True)
            moved = [Followed(a.joint_angles + d.joint_angles, a.converged) for a, d in pairs]
            moves.append(differences(base, self._read(other, moved, variation.histories, parts)))
        failed = int(sum((~path.converged).sum() for path in paths))
        return Prediction(base, failed), tuple(moves)

    def _fine(self, histories: Sequence[History], parts: int) -> Sequence[History]:
        """Return histories at every step, closed valves applied first; those of the measured runs are cached."""
        if parts == 1:
            return histories
        kept = self._finer if histories is self._histories else {}
        if parts not in kept:
            kept[parts] = [held(history).refined(parts) for history in histories]
        return kept[parts]

    def __getstate__(self) -> dict[str, object]:
        """Return the state for copies and workers, without the cached histories."""
        return {**vars(self), "_finer": {}}

    def _held(self, model: Model, histories: Sequence[History], parts: int) -> Prediction:
        """Return the readings of a joint whose coordinate is prescribed; effects of inputs act on its supply alone."""
        fine = [history.refined(parts) for history in histories]
        reached = [model.commanded(without_held(model.chain, history)) for history in fine]
        coordinates = prescribed_motion(model.chain, fine)
        paths = [Followed(u[:, None, None], np.ones(len(u), bool)) for u in coordinates]
        efforts = blocked_efforts(model.chain, reached, coordinates)
        return Prediction(self._read(model, paths, reached, parts, efforts), 0)

    def _changed(self, model: Model, effects: Sequence[EffectConfig]) -> Model:
        for config in effects:
            model = self.context.build("effect", config).apply(model)
        check_terms(self.backend, model.chain)
        return model

    def _read(
        self,
        model: Model,
        paths: Sequence[Followed],
        histories: Sequence[History],
        parts: int,
        efforts: Sequence[Array] = (),
        own: bool = True,
    ) -> tuple[RunReadings, ...]:
        """Return the sensors' readings at the samples of each run's path under the inputs that act on the chain.

        `efforts` (t,) of each run are the reactions of a held joint; `own`: they are the measured runs.
        """
        runs = self._unturned(model, paths, histories, parts, efforts)
        if self._alignment.idle:
            return runs
        aligned = self._alignment if own else self._alignment.frozen(self.turns, self.measurement)
        return tuple({name: run[name] for name in self.outputs} for run in aligned.applied(runs, own))

    def _unturned(
        self,
        model: Model,
        paths: Sequence[Followed],
        histories: Sequence[History],
        parts: int,
        efforts: Sequence[Array] = (),
    ) -> tuple[RunReadings, ...]:
        """Return the readings in the frames of the world and the module, with all components of rotated outputs."""
        wanted = self._wanted()
        q = np.concatenate([path.joint_angles for path in paths])
        base_angles = np.concatenate([history.base_angles_rad for history in histories])
        true = self._true(model, q, base_angles)
        of_runs = {name: run_by_run(values, histories) for name, values in true.items()}
        of_runs |= {name: list(efforts) for name in BLOCKED.values() if efforts and name in self.outputs}
        runs, whole = [], bool(np.concatenate([path.converged for path in paths]).all())
        for k, (path, history) in enumerate(zip(paths, histories, strict=True)):
            run = {name: of_runs[name][k] for name in wanted}
            if model.outputs:  # maps of the readings also depend on the clock and the actuation
                clock = {} if history.time_s is None else {"time_s": history.time_s}
                pushed = sum(history.actuation[actuator.input] for actuator in model.chain.actuators)
                reported = model.reported({**run, **clock, "actuation": pushed})
                run = {name: np.asarray(reported[name], float) for name in wanted}
            if not (whole or path.converged.all()):
                run = {name: np.where(path.converged, values, np.nan) for name, values in run.items()}
            if history.time_s is not None and parts > 1:
                run = {name: values[::parts] for name, values in run.items()}
            if history.lead:
                run = {name: values[history.lead :] for name, values in run.items()}
            runs.append(run)
        return tuple(runs)

    def _true(self, model: Model, q: Array, base_angles: Array) -> RunReadings:
        """Return every output (t,) without sensor effects, from coordinates q (t, n, a) and base angles (t, 3)."""
        angles, wanted = q[:, :, self._geometry.main], self._wanted()
        markers, turned = None, None
        if any(POSITION.fullmatch(name) for name in wanted):
            geometry = ChainGeometry.from_chain(model.chain)
            bases = base_rotations(geometry.base_rotation, base_angles)
            markers = trajectory(geometry, q, bases)
            turned = orientations(geometry, q, bases) if self.measurement.marker_offsets_m else None
        readings: RunReadings = {}
        for name in wanted:
            if joint := JOINT_ANGLE.fullmatch(name):
                readings[name] = self._about(q, joint[2])[:, int(joint[1]) - 1]
            elif bend := BEND.fullmatch(name):
                total = self._about(q, bend[2]).sum(axis=1)
                readings[name] = total / self.chain.length_m if bend[1] == "curvature" else total
            elif position := POSITION.fullmatch(name):
                assert markers is not None
                place = self._marker(markers, position[2], turned)
                readings[name] = place[:, "xyz".index(position[3])]
            elif name in BLOCKED.values():
                continue  # from the laws, not from the pose
            elif name == "elongation_strain":
                readings[name] = angles.sum(axis=1) / self.chain.length_m
            elif name == "extension_m" and self._geometry.slide is not None:
                readings[name] = q[:, :, self._geometry.slide].sum(axis=1)
            else:
                readings[name] = angles.sum(axis=1)
        return readings

    def _about(self, q: Array, axis: str | None) -> Array:
        """Return (t, n) the joints' coordinates about module y or z; the main ones if no axis is named."""
        return q[:, :, self._geometry.main if axis is None else self._geometry.axes.index(axis)]

    def _wanted(self) -> tuple[str, ...]:
        """Return the outputs, and with rotated frames all components of the rotated ones."""
        if not self._alignment.sessions:
            return self.outputs
        more = (other for name in self.outputs for other in components(name))
        return tuple(dict.fromkeys((*self.outputs, *(name for name in more if self._has(name)))))

    def _reached(self, model: Model, histories: Sequence[History]) -> list[History]:
        """Return the histories that act on the chain; those of released chains get their initial holding moment."""
        found = [model.commanded(history) for history in histories]
        for k, history in enumerate(found):
            if history.let_go is not None:
                bend = first_bend(
                    history.let_go, self.measurement.runs[k].outputs, self.chain.length_m, history.run
                )
                found[k] = released(
                    require_histories(self.backend), model.chain, history, bend, self._geometry.main
                )
        return found

    def _marker(self, markers: Array, number: str | None, turned: Array | None) -> Array:
        """Return (t, 3) the tip, or a marker by its number from 1: at its arm length, or else joints and then the tip.

        `turned` (t, n + 1, 3, 3) are the bodies' orientations, needed for markers off the centre line.
        """
        if number is None:
            return markers[:, -1]
        arms = self.measurement.marker_arms_m
        if not arms:
            return markers[:, int(number)]
        ends = self._arms()
        arm = float(np.clip(arms[int(number) - 1], 0.0, ends[-1]))
        piece = max(int(np.searchsorted(ends, arm, side="left")) - 1, 0)
        span = ends[piece + 1] - ends[piece]
        share = (arm - ends[piece]) / span if span else 0.0
        place = (1.0 - share) * markers[:, piece] + share * markers[:, piece + 1]
        if turned is not None:
            place = place + turned[:, piece] @ np.asarray(self.measurement.marker_offsets_m[int(number) - 1])
        return np.asarray(place)

    def _arms(self) -> Array:
        """Return (n + 2,) positions of base, joints and tip along the chain at rest."""
        lengths = [float(np.linalg.norm(joint.offset_m)) for joint in self.chain.joints]
        return np.cumsum([0.0, *lengths, float(np.linalg.norm(self.chain.tip_offset_m))])

    def _readable(self, wanted: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        has = tuple(name for name in wanted if self._has(name))
        return has, tuple(name for name in wanted if name not in has)

    def _has(self, name: str) -> bool:
        n, prismatic = self._geometry.n_joints, self._geometry.kind == "prismatic"
        if joint := JOINT_ANGLE.fullmatch(name):
            return self._turns_about(joint[2]) and 1 <= int(joint[1]) <= n
        if position := POSITION.fullmatch(name):
            markers = len(self.measurement.marker_arms_m) or n + 1
            return position[2] is None or 1 <= int(position[2]) <= markers
        if any(map(is_held, self._histories)):
            return name == BLOCKED.get(self._geometry.kind)
        if bend := BEND.fullmatch(name):
            return self._turns_about(bend[2])
        return name in TRAVELS and (prismatic or (name == "extension_m" and self._geometry.slide is not None))

    def _turns_about(self, axis: str | None) -> bool:
        """Return whether the joints rotate, about module y or z if one is named."""
        return self._geometry.turns and (axis is None or axis in self._geometry.axes)


def _fitting_parts(model: Model, parts: int) -> int:
    """Return `parts`, or 1 with inertia: its term is of second order and damps oscillations between the samples."""
    return 1 if any(term.is_inertia for term in model.chain.terms) else parts


def _extrapolated(fine: Sequence[RunReadings], coarse: Sequence[RunReadings]) -> tuple[RunReadings, ...]:
    """Return readings of second order in the step, from two of first order, one with twice the steps of the other."""
    return tuple(
        {name: 2.0 * values - b[name] for name, values in a.items()}
        for a, b in zip(fine, coarse, strict=True)
    )


def _range(runs: Sequence[Mapping[str, Array]], name: str) -> float:
    values = np.concatenate([run[name] for run in runs])
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if len(finite) else 0.0


def _change(one: Sequence[RunReadings], other: Sequence[RunReadings], name: str) -> float:
    """Return the root mean square change of an output over the samples that both have."""
    difference = np.concatenate([a[name] - b[name] for a, b in zip(one, other, strict=True)])
    there = difference[np.isfinite(difference)]
    return float(np.sqrt(np.mean(there**2))) if len(there) else 0.0


POSITIONS = ("tip_x_m", "tip_y_m", "tip_z_m")


def expected_ranges(chain: ChainModel) -> Mapping[str, tuple[float, float]]:
    """Return column → expected range, for inputs, angles and positions."""
    domains = [chain.laws[joint.law].domain for joint in chain.joints]
    low = float(min(np.min(domain.actuation) for domain in domains))
    high = float(max(np.max(domain.actuation) for domain in domains))
    ranges = {actuator.input: (low, high) for actuator in chain.actuators}
    reach = float(np.linalg.norm(chain.base_position_m)) + chain.length_m
    ranges |= dict.fromkeys(POSITIONS, (-reach, reach))
    if chain.laws[0].joint != "prismatic":
        bends = sum(float(np.max(np.abs(domain.deformation))) for domain in domains)
        ranges["angle_rad"] = (-bends, bends)
    return {name: span for name, span in ranges.items() if np.isfinite(span).all()}
