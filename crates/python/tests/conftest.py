"""What tests share: a small box, baked once, and the command line to hold the module against."""

import os
import pathlib
import shutil
import signal
import subprocess

import pytest

import relight

ROOT = pathlib.Path(__file__).resolve().parents[3]
DATA = ROOT / "data"
SMALL = {"preset": "draft", "levels": 3, "sender_levels": 2, "coarse_radius": 0.2, "epsilon": 0.08}

# Jobs in a shell's background ignore Ctrl-C, and Python then leaves it so: tests of it need what a terminal has.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def asset(tmp_path_factory):
    """The box of `data`, baked in a second."""
    return relight.bake(DATA / "cornell.glb", tmp_path_factory.mktemp("asset") / "cornell.relight", **SMALL)


@pytest.fixture(scope="session")
def command_line():
    """Runs the program `relight`: what RELIGHT names, or a build's. Without one, tests against it fail: build it, or say
    RELIGHT=none to leave them out."""
    name = os.environ.get("RELIGHT")
    if name == "none":
        pytest.skip("RELIGHT=none: NOT held against the command line")
    found = [name, ROOT / "target/release/relight", ROOT / "target/debug/relight", shutil.which("relight")]
    program = next((path for path in found if path and pathlib.Path(path).is_file()), None)
    assert program, "no program relight: cargo build, or name it by the variable RELIGHT"

    def run(*words, code=0):
        done = subprocess.run([program, *map(str, words)], capture_output=True, text=True)
        assert done.returncode == code, done.stderr
        return done

    return run
