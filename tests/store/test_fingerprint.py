"""Editing a plugin's code changes the fingerprint of exactly what depends on it."""

import importlib
import sys
import textwrap

import pytest

from pliant.store.fingerprint import code_closure, code_fingerprint, versions

FILES = {
    "__init__.py": '"""A package."""\n',
    "family.py": "from {name} import mesh\nfrom {name}.helpers.maths import double\nimport numpy\n",
    "mesh.py": "from .helpers import maths\nVALUE = 1\n",
    "helpers/__init__.py": "",
    "helpers/maths.py": '''
        def double(x):
            """Twice x."""
            return 2 * x  # a comment
    ''',
    "other.py": "VALUE = 2\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    name = "fingerprinted_package"
    for file, text in FILES.items():
        path = tmp_path / name / file
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(textwrap.dedent(text).replace("{name}", name))
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    yield tmp_path / name
    for module in [m for m in sys.modules if m.startswith(name)]:
        del sys.modules[module]


def fingerprint(package):
    return code_fingerprint([f"{package.name}.family"])


def test_the_closure_follows_every_form_of_import(package):
    names = {name.removeprefix(package.name + ".") for name in code_closure([f"{package.name}.family"])}
    assert {"family", "mesh", "helpers.maths"} <= names
    assert "other" not in names
    assert not any(name.startswith("numpy") for name in names)


@pytest.mark.parametrize("file", ["family.py", "mesh.py", "helpers/maths.py"])
def test_editing_code_or_a_helper_changes_it(package, file):
    before = fingerprint(package)
    with (package / file).open("a") as source:
        source.write("\nNEW = 3\n")
    assert fingerprint(package) != before


def test_editing_a_comment_a_docstring_or_another_module_does_not(package):
    before = fingerprint(package)
    maths = package / "helpers" / "maths.py"
    maths.write_text(
        maths.read_text().replace("# a comment", "# another").replace("Twice x.", "Two times x.")
    )
    (package / "other.py").write_text("VALUE = 3\n")
    assert fingerprint(package) == before


def test_a_surrogate_does_not_depend_on_the_fem_plugin():
    closure = code_closure(["pliant_plugins.surrogates.polynomial.surrogate"])
    assert not any("fem.skfem" in name or "families" in name for name in closure)


def test_versions_of_required_libraries():
    assert versions(["numpy"])["numpy"].count(".") >= 1
    assert versions(["no_such_module"]) == {}
