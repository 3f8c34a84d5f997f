"""What ``import imufit`` gives: every public name, loaded on first use, with no module in a function's place."""

import ast
import subprocess
import sys
from pathlib import Path
from types import FunctionType, ModuleType

import imufit
import pytest
from imufit import _imufit


def test_all_public_names_exist_and_are_listed():
    listed = dir(imufit)
    for name in imufit.__all__:
        assert getattr(imufit, name) is not None
        assert name in listed


def test_import_alone_loads_no_package_of_others():
    script = (
        "import sys; before = set(sys.modules); import imufit;"
        "heavy = {m.split('.')[0] for m in set(sys.modules) - before} - {'imufit'} - set(sys.stdlib_module_names);"
        "sys.exit(f'imported {sorted(heavy)}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_functions_stay_functions_when_modules_of_the_same_name_are_loaded():
    script = (
        "import imufit.diagnosing.ladder, imufit.replaying.replay, imufit.model.effect, imufit.model.catalogue, imufit;"
        "assert callable(imufit.ladder) and callable(imufit.effect) and callable(imufit.catalogue);"
        "assert callable(imufit.replaying.replay) and callable(imufit.lab.simulate.simulate)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_question_is_a_function():
    questions = ["calibrate", "compare", "diagnose", "export", "fit", "ladder", "replay", "simulate"]
    questions += ["allan", "info", "join", "plot", "tune"]
    assert all(isinstance(getattr(imufit, name), FunctionType) for name in questions)
    assert isinstance(imufit.lab.grade, ModuleType)
    assert isinstance(imufit.devices.record, ModuleType)


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'imufit' has no attribute 'nothing'"):
        _ = imufit.nothing


def test_every_export_of_the_compiled_module_is_in_the_stub():
    stub = ast.parse((Path(imufit.__file__).parent / "_imufit.pyi").read_text(encoding="utf-8"))
    described: dict[str, ast.stmt] = {}
    for node in stub.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            described[node.name] = node
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            described[node.target.id] = node
    exported = {name for name in dir(_imufit) if not name.startswith("_")} | {"__version__"}
    assert exported <= described.keys()
    assert {name for name in described if not name.startswith("_")} <= exported
    for name in exported:
        node = described[name]
        if isinstance(node, ast.ClassDef):
            members = {m.name for m in node.body if isinstance(m, ast.FunctionDef)}
            members |= {
                m.target.id for m in node.body if isinstance(m, ast.AnnAssign) and isinstance(m.target, ast.Name)
            }
            assert {member for member in dir(getattr(_imufit, name)) if not member.startswith("_")} <= members
