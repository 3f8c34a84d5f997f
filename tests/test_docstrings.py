"""Every public function and class says what it does, and names each of its parameters."""

import dataclasses
import importlib
import inspect
import re
from collections.abc import Iterator

import pytest
from imufit import _imufit

PARTS = (
    "log",
    "replaying",
    "model",
    "fitting",
    "comparing",
    "diagnosing",
    "inspection",
    "joining",
    "calibrating",
    "results",
    "report",
    "exporting",
    "allan_deviation",
    "tuning",
    "devices.chips.mpu6050",
    "devices.emulate",
    "devices.record",
    "devices.monitor",
    "lab.simulate",
    "lab.grade",
)
WITHOUT_ENTRY = {"self", "cls"}


def methods(owner: type) -> Iterator[tuple[str, object]]:
    """Public methods and properties that a class defines itself."""
    for name, member in vars(owner).items():
        plain = member.__func__ if isinstance(member, classmethod | staticmethod) else member
        is_method = inspect.isfunction(plain) and plain.__name__ == name
        if not name.startswith("_") and (is_method or isinstance(plain, property)):
            yield name, plain


def exported() -> Iterator[tuple[str, object]]:
    """Public classes and functions with the public methods of the classes, each once."""
    seen = set()
    for package in ("imufit", *(f"imufit.{part}" for part in PARTS)):
        module = importlib.import_module(package)
        for name in module.__all__:
            value = getattr(module, name)
            if not (inspect.isclass(value) or inspect.isfunction(value)) or value in seen:
                continue
            seen.add(value)
            yield f"{package}.{name}", value
            if inspect.isclass(value):
                for method, member in methods(value):
                    yield f"{package}.{name}.{method}", member


def entries(doc: str, section: str) -> set[str]:
    """Names described under a numpy-style heading; `a, b : type` describes two."""
    match = re.search(rf"^{section}\n-+\n(.*?)(?=^\S[^\n]*\n-+\n|\Z)", doc, flags=re.M | re.S)
    lines = match.group(1).splitlines() if match else []
    names = (line.split(" : ")[0] for line in lines if line and not line.startswith(" "))
    return {name.strip().lstrip("*") for group in names for name in group.split(",")}


OBJECTS = dict(exported())


@pytest.mark.parametrize("name", OBJECTS)
def test_docstring_names_every_parameter(name):
    value = OBJECTS[name]
    doc = inspect.cleandoc(value.__doc__ or "")
    assert doc, "has no docstring"
    assert doc.splitlines()[0].endswith((".", "?", "!", ":")), "the first line is no sentence"
    if isinstance(value, property):
        return
    if dataclasses.is_dataclass(value):
        wanted = {field.name for field in dataclasses.fields(value) if field.init}
        described = entries(doc, "Attributes") | entries(doc, "Parameters")
    elif inspect.isclass(value):
        own = None if getattr(value, "_is_protocol", False) else vars(value).get("__init__")
        wanted = set(inspect.signature(own).parameters) if own else set()
        described = entries(doc, "Parameters") | entries(doc, "Attributes")
    else:
        wanted = set(inspect.signature(value).parameters)
        described = entries(doc, "Parameters")
    assert wanted - WITHOUT_ENTRY - described == set(), "parameters without a description"


COMPILED = [name for name in _imufit.__all__ if not name.startswith("__")]


@pytest.mark.parametrize("name", COMPILED)
def test_compiled_function_class_and_member_has_a_docstring(name):
    value = getattr(_imufit, name)
    assert value.__doc__
    if inspect.isclass(value):
        missing = [key for key in vars(value) if not key.startswith("_") and not getattr(value, key).__doc__]
        assert missing == []
