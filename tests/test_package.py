"""What ``import imufit`` gives: every public name, loaded on first use, with no module in a function's place."""

import subprocess
import sys
from types import ModuleType

import imufit
import pytest


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
        "import imufit.diagnose.ladder, imufit.replay.replay, imufit.model.effect, imufit.model.catalogue, imufit;"
        "assert callable(imufit.ladder) and callable(imufit.effect) and callable(imufit.catalogue);"
        "assert callable(imufit.replay.replay) and callable(imufit.simulate.simulate)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_replay_and_simulate_are_modules():
    assert isinstance(imufit.replay, ModuleType)
    assert isinstance(imufit.simulate, ModuleType)


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'imufit' has no attribute 'nothing'"):
        _ = imufit.nothing
