"""What goes wrong is said in the words of the command line, and stops nothing else."""

import os
import signal
import subprocess
import sys
import textwrap
import threading
import time

import numpy as np
import pytest
import relight
from conftest import DATA, SMALL


def words(done):
    """What the command line says, less its name."""
    return done.stderr.strip().splitlines()[-1].split("error: ", 1)[1]


def test_errors_have_the_words_of_the_command_line(asset, command_line, tmp_path):
    broken = tmp_path / "broken.relight"
    broken.write_bytes(asset.path.read_bytes()[:-50])
    missing = tmp_path / "missing.relight"
    lights = tmp_path / "lights.json"
    lights.write_text('{"relight_sequence": 1, "lights": [{"name": "a", "type": "point", "intensity": [1, 1, 1]}]}')
    frame = tmp_path / "f.exr"
    played = lambda *more, of=asset.path: words(command_line("play", of, *more, "-o", frame, "-q", code=1))  # noqa: E731
    for ours, theirs in [
        (lambda: relight.open(broken), played(of=broken)),
        (lambda: asset.lights(lights), played("--lights", lights)),
        (lambda: asset.lights(missing), played("--lights", missing)),
        (lambda: asset.shot("nowhere"), played("--camera", "nowhere")),
        (lambda: asset.shot(integrator="cuts"), played("--integrator", "cuts")),
        (lambda: relight.bake(missing, frame), words(command_line("bake", missing, "-o", tmp_path / "a", "-q", code=1))),
    ]:
        with pytest.raises(relight.Error) as error:
            ours()
        assert str(error.value) == theirs
    with pytest.raises(relight.Error, match="missing.relight"):
        relight.open(missing)


def test_misuse_is_told(asset, tmp_path):
    scene = DATA / "cornell.glb"
    for call, said in [
        (lambda: asset.shot(size=(0, 10)), "size"),
        (lambda: asset.shot(size=(10, 99999)), "16384"),
        (lambda: asset.shot(spp=0), "spp"),
        (lambda: asset.shot(integrator="magic"), "transfer"),
        (lambda: relight.bake(scene, tmp_path / "a", preset="best"), "draft, standard or fine"),
        (lambda: relight.bake(scene, tmp_path / "a", levels=99), "levels"),
        (lambda: relight.bake(scene, tmp_path / "a", keep=["everything"]), "senders"),
        (lambda: relight.write_exr(tmp_path / "a.exr", np.zeros((2, 2, 4))), "(height, width, 3)"),
        (lambda: relight.write_exr(tmp_path / "a.exr", {"a": np.zeros((2, 2)), "b": np.zeros((2, 3))}), "3 × 2"),
    ]:
        with pytest.raises(ValueError) as error:
            call()
        assert said in str(error.value)
    for call in [
        lambda: asset.shot(size=(8, 8)).frame(lights=[3]),
        lambda: asset.shot(camera=3),
        lambda: relight.Point(),
    ]:
        with pytest.raises(TypeError):
            call()
    shot = asset.shot(size=(4, 4))
    for lamp in [relight.Point((0, 0, 0), -1.0), relight.Point((0, 0)), relight.Point((0, 0, np.nan))]:
        with pytest.raises(relight.Error, match="lights"):
            shot.frame(lamp)
    with pytest.raises(ValueError):
        shot.frame(time=float("nan"))
    assert not list(tmp_path.iterdir())


def test_nothing_is_replaced_but_assets(asset, tmp_path):
    scene = tmp_path / "box.glb"
    scene.write_bytes((DATA / "cornell.glb").read_bytes())
    thesis = tmp_path / "thesis.txt"
    thesis.write_text("my thesis")
    for out in [scene, thesis]:
        before = out.read_bytes()
        with pytest.raises(relight.Error, match="is not replaced"):
            relight.bake(scene, out, **SMALL)
        assert out.read_bytes() == before


def test_what_has_no_room_is_not_begun(tmp_path, monkeypatch):
    out = tmp_path / "a.relight"
    with pytest.raises(relight.Error, match="MB of memory"):
        relight.bake(DATA / "cornell.glb", out, **{**SMALL, "coarse_radius": 1e-4})
    # A system whose disk is nearly full.
    df = tmp_path / "bin" / "df"
    df.parent.mkdir()
    df.write_text("#!/bin/sh\necho head\necho /dev/a 1000 999 1 99% /\n")
    df.chmod(0o755)
    monkeypatch.setenv("PATH", str(df.parent), prepend=os.pathsep)
    with pytest.raises(relight.Error, match="its disk has 1 kB left"):
        relight.bake(DATA / "cornell.glb", out, preset="draft")
    assert not out.exists()


def test_lights_of_another_asset_are_refused(asset):
    lights = relight.open(asset.path).lights()
    with pytest.raises(ValueError, match="another asset"):
        asset.shot(size=(4, 4)).frame(lights)


def test_other_threads_run_while_relight_works(asset):
    """Truth: a thread of Python counts while a frame is traced that takes a second or more."""
    shot = asset.shot(size=(160, 120), spp=64, integrator="path")
    worker = threading.Thread(target=shot.frame, args=([relight.Point((0.2, 0.4, 0.1))],))
    start, longest = time.perf_counter(), 0.0
    worker.start()
    last = start
    while worker.is_alive():
        time.sleep(0.001)
        now = time.perf_counter()
        longest, last = max(longest, now - last), now
    took = last - start
    assert took > 0.1 and longest < 0.5 * took, (took, longest)


def test_threads_share_a_shot(asset):
    """Truth: one frame after another."""
    shot = asset.shot(size=(32, 24))
    lamps = [relight.Point((x, 0.4, 0.1), 1.0, name="lamp") for x in (0.1, 0.2, 0.3, 0.4)]
    alone = [shot.frame(lamp)["beauty"] for lamp in lamps]
    together = [None] * len(lamps)

    def work(i):
        together[i] = shot.frame(lamps[i])["beauty"]

    threads = [threading.Thread(target=work, args=(i,)) for i in range(len(lamps))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for one, other in zip(alone, together):
        np.testing.assert_array_equal(one, other)


@pytest.mark.skipif(os.name != "posix", reason="signals of this system are others: NOT tested")
def test_ctrl_c_stops_a_bake_and_leaves_nothing(tmp_path):
    script = f"""
        import relight
        print("begin", flush=True)
        try:
            relight.bake({str(DATA / "atrium.glb")!r}, {str(tmp_path / "a.relight")!r}, preset="fine")
        except KeyboardInterrupt:
            print("stopped", flush=True)
    """
    child = subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "begin\n"
    time.sleep(3)
    start = time.perf_counter()
    child.send_signal(signal.SIGINT)
    assert child.stdout.read() == "stopped\n"
    assert child.wait(30) == 0
    assert time.perf_counter() - start < 10
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="signals of this system are others: NOT tested")
def test_ctrl_c_stops_a_frame(asset):
    shot = asset.shot(size=(640, 480), spp=256, integrator="path")
    threading.Timer(0.5, signal.raise_signal, [signal.SIGINT]).start()
    start = time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        shot.frame(relight.Point((0.2, 0.4, 0.1)))
    assert time.perf_counter() - start < 10
    # And it works on.
    assert asset.shot(size=(4, 4)).frame()["beauty"].shape == (4, 4, 3)
