"""Editing a plugin's code changes the fingerprint of exactly what depends on it."""

import importlib
import sys
import textwrap

import pytest

from pliant.store.fingerprint import _kept, code_closure, code_fingerprint, versions

FILES = {
    "__init__.py": '"""A package."""\n',
    "family.py": ("from {name} import config, mesh\nfrom {name}.helpers.maths import double\nimport numpy\n"),
    "mesh.py": (
        "from .helpers import maths\nimport importlib\nVALUE = 1\n"
        "def late():\n    importlib.import_module('.nearby', __package__)\n"
        "    return importlib.import_module('{name}.lazy')\n"
    ),
    "helpers/__init__.py": "",
    "helpers/maths.py": '''
        def double(x):
            """Twice x."""
            return 2 * x  # a comment
    ''',
    "other.py": "VALUE = 2\n",
    "lazy.py": "VALUE = 4\n",
    "nearby.py": "VALUE = 5\n",
    "tables/stiffness.json": "[1, 2]",
    "helpers/gains.csv": "1,2",
    "apart/__init__.py": "",
    "apart/unused.json": "[1]",
    "README.md": "words",
    "config.py": 'from pydantic import Field\nX: int = Field(default=1, description="one")\n',
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


def test_the_closure_follows_every_import_form(package):
    names = {name.removeprefix(package.name + ".") for name in code_closure([f"{package.name}.family"])}
    assert {"family", "mesh", "helpers.maths"} <= names
    assert "other" not in names
    assert not any(name.startswith("numpy") for name in names)


def test_editing_a_comment_a_docstring_or_another_module_does_not(package):
    before = fingerprint(package)
    maths = package / "helpers" / "maths.py"
    maths.write_text(
        maths.read_text().replace("# a comment", "# another").replace("Twice x.", "Two times x.")
    )
    (package / "other.py").write_text("VALUE = 3\n")
    assert fingerprint(package) == before


def test_data_in_other_packages_and_documentation_do_not(package):
    before = fingerprint(package)
    (package / "apart" / "unused.json").write_text("[3]")
    (package / "README.md").write_text("other words")
    (package / "__pycache__").mkdir(exist_ok=True)
    (package / "__pycache__" / "x.json").write_text("[3]")
    config = package / "config.py"
    config.write_text(config.read_text().replace('"one"', '"uno"'))
    assert fingerprint(package) == before
    config.write_text(config.read_text().replace("default=1", "default=2"))
    assert fingerprint(package) != before


def test_another_plugins_package_is_followed(package):
    (package / "mesh.py").write_text("import fingerprinted_other.base\n")
    other = package.parent / "fingerprinted_other"
    other.mkdir()
    (other / "__init__.py").write_text("")
    (other / "base.py").write_text("VALUE = 1\n")
    importlib.invalidate_caches()
    modules = [f"{package.name}.family"]
    before = code_fingerprint(modules, ["fingerprinted_other"])
    alone = code_fingerprint(modules)
    (other / "base.py").write_text("VALUE = 2\n")
    assert code_fingerprint(modules, ["fingerprinted_other"]) != before
    assert code_fingerprint(modules) == alone


def test_a_helper_that_is_no_python_is_hashed_as_it_is(package):
    (package / "other.py").write_text("this is not python")
    (package / "mesh.py").write_text("def late():\n    from . import other\n")
    before = fingerprint(package)
    (package / "other.py").write_text("nor is this")
    assert fingerprint(package) != before


def test_a_surrogate_does_not_depend_on_the_fem_plugin():
    closure = code_closure(["pliant_plugins.surrogates.polynomial.surrogate"])
    assert not any("fem.skfem" in name or "families" in name for name in closure)


def test_required_library_versions():
    assert versions(["numpy"])["numpy"].count(".") >= 1
    assert versions(["no_such_module"]) == {}


CODE = [
    "family.py",
    "mesh.py",
    "helpers/maths.py",
    "lazy.py",
    "nearby.py",
    "__init__.py",
    "helpers/__init__.py",
]


@pytest.mark.parametrize("file", [*CODE, "tables/stiffness.json", "helpers/gains.csv"])
def test_editing_code_a_helper_or_a_data_file_beside_them_changes_it(package, file):
    before = fingerprint(package)
    with (package / file).open("a") as source:
        source.write("\nNEW = 3\n")
    changed = fingerprint(package)
    assert changed != before
    if file not in CODE:
        (package / file).unlink()
        assert fingerprint(package) not in (before, changed)


def test_a_module_that_lies_alone_has_no_data(tmp_path, monkeypatch):
    (tmp_path / "lonely_module.py").write_text("VALUE = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    importlib.invalidate_caches()
    before = code_fingerprint(["lonely_module"])
    (tmp_path / "data.json").write_text("1")
    assert code_fingerprint(["lonely_module"]) == before


@pytest.mark.parametrize("torn", [False, True])
def test_what_is_kept_beside_the_byte_code_says_the_same(package, tmp_path, monkeypatch, torn):
    before, closure = fingerprint(package), code_closure([f"{package.name}.family"])  # in memory, parsed
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.setattr(sys, "pycache_prefix", str(tmp_path / "kept"))
    _kept.cache_clear()
    assert fingerprint(package) == before
    files = [*(tmp_path / "kept").rglob("mesh.*.fingerprint")]
    assert len(files) == 1
    _kept.cache_clear()
    with monkeypatch.context() as patch:
        if torn:
            files[0].write_text(files[0].read_text()[:70])
        else:
            patch.setattr("pliant.registry.source_code.ast.parse", lambda source: pytest.fail("parsed again"))
        assert fingerprint(package) == before and code_closure([f"{package.name}.family"]) == closure
    (package / "mesh.py").write_text("VALUE = 3\n")
    changed = fingerprint(package)
    _kept.cache_clear()
    assert fingerprint(package) == changed != before


def test_a_module_attribute_does_not_run_it(package):
    (package / "family.py").write_text("from .other import VALUE\n")
    (package / "other.py").write_text("raise RuntimeError\nVALUE = 2\n")
    assert f"{package.name}.other" in code_closure([f"{package.name}.family"])
    (package / "other.py").write_text("VALUE = 3\n")
    code_closure([f"{package.name}.family"])
    assert f"{package.name}.other" not in sys.modules
