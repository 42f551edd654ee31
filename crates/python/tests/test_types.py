"""Stubs say what is there; the examples run, those of the page, too."""

import inspect
import pathlib
import re
import shutil
import subprocess
import sys
import warnings

import pytest
import relight
from conftest import DATA, ROOT

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


# What others of them import is no script.
SCRIPTS = sorted(path.name for path in EXAMPLES.glob("*.py") if "__main__" in path.read_text())


@pytest.mark.parametrize("script", SCRIPTS)
def test_examples_run(script, asset, tmp_path):
    done = subprocess.run(
        [sys.executable, EXAMPLES / script, asset.path, "--size", "32", "24"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout, "says what it found"


def test_the_page_says_what_works(tmp_path, monkeypatch):
    sparse = pytest.importorskip("scipy.sparse", reason="no scipy: the page's examples were NOT run")
    import scipy

    assert scipy.sparse is sparse
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "python.md").read_text(), re.DOTALL)
    assert len(blocks) == 3
    monkeypatch.chdir(tmp_path)
    shutil.copy(DATA / "cornell.glb", "hall.glb")
    names = {"scipy": scipy, "warnings": warnings}
    with warnings.catch_warnings():
        for block in blocks:
            exec(block, names)
    assert 0 < names["asset"].expected["error"] < 0.25
    assert names["frame"]["beauty"].shape == (360, 640, 3)
    assert names["K"].shape[0] == names["K"].shape[1] and names["Tx"].nnz == len(names["T"].data)
