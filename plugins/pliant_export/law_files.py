"""Laws as files: the available formats, and the file of each law."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from pliant.records.law import JointLaw
from pliant_export.as_json import as_json
from pliant_export.in_c import in_c
from pliant_export.in_python import in_python
from pliant_export.written_law import WrittenLaw, identifier, written

LAW_FORMATS: dict[str, Callable[[WrittenLaw], str]] = {
    "c": in_c,
    "numpy": partial(in_python, dialect="numpy"),
    "torch": partial(in_python, dialect="torch"),
    "jax": partial(in_python, dialect="jax"),
    "json": as_json,
}
ENDINGS = {"c": "h", "numpy": "py", "torch": "py", "jax": "py", "json": "json"}


def write_laws(laws: Sequence[JointLaw], path: Path, form: str) -> tuple[Path, ...]:
    """Write each distinct law to a separate file: `path`, then `<name>_2`, `<name>_3` in the same folder.

    Functions are named after their files.

    Raises:
        UserError: a law that cannot be written.
    """
    distinct = list(dict.fromkeys(laws))
    paths = [path.with_stem(f"{path.stem}_{k}") if k > 1 else path for k in range(1, len(distinct) + 1)]
    texts = [
        LAW_FORMATS[form](written(law, identifier(one.stem)))
        for law, one in zip(distinct, paths, strict=True)
    ]
    for one, text in zip(paths, texts, strict=True):
        one.write_text(text, encoding="utf-8")
    return tuple(paths)
