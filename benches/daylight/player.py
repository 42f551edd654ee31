"""relight's way: an asset, then daylight coefficients, from the command line."""

import json
import os
import pathlib
import shutil
import subprocess
import time

import numpy as np

import scenes
import sky
from processes import Failed, pipeline, seconds

# A sky seen by itself, to read what each of its patches has: four views up, which overlap.
BARE_SIZE = (128, 128)
BARE_VFOV = 110


def processor_time(pid):
    """CPU seconds that a running process has taken."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Player:
    def __init__(self, relight, folder, threads):
        self.relight, self.folder, self.threads = relight, folder, threads
        folder.mkdir(parents=True, exist_ok=True)

    def sequence(self, days):
        path = self.folder / f"days{days}.json"
        path.write_text(json.dumps(sky.sequence(days)))
        return path

    def bake(self, scene, preset):
        """CPU seconds."""
        glb = self.folder / f"{scene.name}.glb"
        scenes.write_glb(scene, glb)
        command = [self.relight, "bake", glb, "-o", self.asset(scene, preset), "--preset", preset]
        command += ["--cuts", "environment", "--lights", self.sequence(1), "--cameras-only"]
        command += ["--threads", self.threads, "--force", "--quiet"]
        return pipeline([list(map(str, command))])

    def asset(self, scene, preset):
        return self.folder / f"{scene.name}.{preset}.relight"

    def frames(self, asset, view, size, out, days=1):
        """Plays the day so many times over, and keeps the frames of the first. CPU seconds of all up to the first frames, and of each
        further one (nothing where they came all at once)."""
        out = self.folder / out
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir()
        command = [self.relight, "play", asset, "--lights", self.sequence(days), "--camera", view.name]
        command += ["--daylight-coefficients", sky.COUNT, "--size", "{}x{}".format(*size), "--layers", "beauty"]
        command += ["-o", out / "####.exr", "--threads", self.threads, "--force", "--quiet"]
        before, first = seconds(), None
        process = subprocess.Popen(list(map(str, command)), stderr=subprocess.PIPE)
        while process.poll() is None:
            if first is None and (out / "0000.exr").exists():
                first = processor_time(process.pid), len(list(out.glob("*.exr")))
            time.sleep(0.005)
        if process.returncode:
            raise Failed(process.stderr.read().decode(errors="replace"))
        took = seconds() - before
        for frame in range(sky.FRAMES, sky.FRAMES * days):
            (out / f"{frame:04}.exr").unlink()
        if first is None or first[1] >= sky.FRAMES * days:
            return took, None
        of_each = (took - first[0]) / (sky.FRAMES * days - first[1])
        return took - of_each * sky.FRAMES * days, of_each

    def sky(self, read):
        """Radiance of the patches over the day, [frame, patch, RGB], as pictures of a bare sky show them."""
        ground = np.array([[[-1, -9, -1], [-1, -9, 1], [1, -9, 1]]], np.float32)
        turns = np.arange(4) * np.pi / 2
        views = [
            scenes.View(f"side{i}", (0, 0, 0), (np.sin(a), 1, -np.cos(a)), BARE_VFOV) for i, a in enumerate(turns)
        ]
        bare = scenes.Scene("bare", [("ground", (0.5, 0.5, 0.5), ground)], views)
        self.bake(bare, "draft")
        pictures = []
        for view in views:
            self.frames(self.asset(bare, "draft"), view, BARE_SIZE, "bare")
            frames = [read(self.folder / "bare" / f"{frame:04}.exr") for frame in range(sky.FRAMES)]
            pictures.append(np.array(frames))
        return sky.seen(pictures, views, BARE_SIZE)
