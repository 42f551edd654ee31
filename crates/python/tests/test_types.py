"""Stubs say what is there; the examples run."""

import inspect
import pathlib
import subprocess
import sys

import pytest
import relight
from conftest import DATA

PACKAGE = pathlib.Path(relight.__file__).parent
EXAMPLES = pathlib.Path(__file__).resolve().parents[1] / "examples"


def test_stubs_are_there_and_true():
    assert (PACKAGE / "py.typed").is_file() and (PACKAGE / "_relight.pyi").is_file()
    pytest.importorskip("mypy", reason="no mypy: stubs NOT checked")
    done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "relight"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_everything_public_is_explained():
    for name in relight.__all__:
        thing = getattr(relight, name)
        assert name.startswith("__") or inspect.getdoc(thing), name


@pytest.mark.parametrize("script", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_examples_run(script, asset, tmp_path):
    done = subprocess.run(
        [sys.executable, EXAMPLES / script, asset.path, "--size", "32", "24"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout, "says what it found"
