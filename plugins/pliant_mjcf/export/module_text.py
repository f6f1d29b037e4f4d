"""The Python module of an improved MJCF: columns, and effects that MJCF cannot say, without Pliant."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pprint import pformat
from typing import Any

from pliant_export.bundled_source import Bundle
from pliant_mjcf.channels import Read
from pliant_mjcf.export.written_model import WrittenModel

COLUMNS, NEEDED = "# Filled in by the export", "# --- what effects need ---"
LISTS, DRIVER = "# Effects that MJCF cannot say", "# --- the driver ---"
CALLED = ("start", "advance")  # by the driver
GIVEN = ("UserError", "ImpossibleEffectError", "Effect", "Run")


def module_text(
    written: WrittenModel,
    model: Any,
    outputs: Sequence[Read],
    fixed: Mapping[str, float],
    mjcf: str,
    file: str,
    about: Sequence[str],
) -> str:
    """Return the text of the module.

    Args:
        written: what MJCF could say, and the rest.
        model: compiled from it.
        outputs: of the study.
        fixed: actuators that are no columns, with their ctrl.
        mjcf, file: names of the MJCF and of the module.
        about: lines of the docstring.

    Raises:
        UserError: an effect that cannot be written.
    """
    driver = resources.files("pliant_mjcf.export.alone").joinpath("improved_driver.py").read_text("utf-8")
    head, rest = driver.split(COLUMNS, 1)
    needed, rest = rest.split(NEEDED, 1)[1].split(LISTS, 1)
    columns = {
        "MJCF": mjcf,
        "INPUTS": {
            one.channel.name: (model.actuator(one.actuator).name, [list(point) for point in one.curve])
            for one in written.inputs
        },
        "FIXED": dict(fixed),
        "OUTPUTS": {one.channel.name: (one.sensor, one.component) for one in outputs},
    }
    bundle = Bundle(GIVEN, (*CALLED, *(("change",) if written.numbers else ())))
    lists = {
        name: "[" + ", ".join(bundle.value(one) for one in found) + "]"
        for name, found in (
            ("INPUT_MAPS", written.input_maps),
            ("OUTPUT_MAPS", written.output_maps),
            ("MODEL_CHANGES", written.numbers),
            ("FORCES", written.forces),
            ("DRIVES", written.drives),
        )
    }
    stated = [f"{name} = {pformat(value, width=110, sort_dicts=False)}" for name, value in columns.items()]
    used = bundle.text().strip() if any(text != "[]" for text in lists.values()) else ""
    return "".join(
        [
            head.replace("{about}", "\n".join(about), 1).replace("{file}", file, 1),
            "# Columns of a recording: actuator and curve of each input, sensor and component of each output.\n",
            "\n".join(stated),
            f"\n\n{NEEDED}",
            needed,
            f"{used}\n\n\n" if used else "",
            f"{LISTS}\n",
            "\n".join(f"{name} = {text}" for name, text in lists.items()),
            f"\n\n{DRIVER}",
            rest.split(DRIVER, 1)[1],
        ]
    )
