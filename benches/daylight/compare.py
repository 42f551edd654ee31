"""relight, Radiance and Mitsuba 3 on a day of daylight: what it takes, and how wrong it is. See README.md beside this file.

    python compare.py --relight ../../target/release/relight --sponza sponza_dabrovic.glb
"""

import argparse
import json
import pathlib
import sys
import tempfile

import numpy as np

import errors
import player
import radiance
import scenes
import sky
import tracer

PRESETS = ("standard", "draft")
# Of a few that were tried, what takes rfluxmtx least time for an error, and the rays a pixel at which it is measured.
FLUX = "-ab 10 -ad 64 -lw 2e-3"
RAYS = (1, 4)
# Days one after the other, for relight's time of a frame.
DAYS = 10
# Of the truth: every so manyth pixel in both directions, and samples of each half.
STEP = 2
SPP = 1024
# Samples of Mitsuba's own path tracer, which makes each frame anew.
PATH_SPP = 32


class Kept:
    """What was measured, in a file: a step that is there is not measured again."""

    def __init__(self, path):
        self.path = path
        self.steps = json.loads(path.read_text()) if path.exists() else {}

    def step(self, name, make):
        if name not in self.steps:
            print(f"… {name}", file=sys.stderr, flush=True)
            self.steps[name] = make()
            self.path.write_text(json.dumps(self.steps, indent=1))
        return self.steps[name]


def array(path, make):
    if not path.exists():
        print(f"… {path.name}", file=sys.stderr, flush=True)
        np.save(path, make())
    return np.load(path)


def judged(images, halves):
    """Of frames that are held against truth: relMSE, its standard error, bias."""
    found = []
    for image, half in zip(images, halves.swapaxes(0, 1)):
        error, deviation = errors.relmse(image, half)
        found.append([error, deviation, errors.bias(image, half)])
    return found


def of_kind(found, kind):
    """Mean of the true frames in which that shines: relMSE, its standard error, bias."""
    chosen = [numbers for numbers, is_kind in zip(found, sky.TRUE.values()) if is_kind == kind]
    error, deviation, bias = np.mean(chosen, axis=0)
    return error, deviation / np.sqrt(len(chosen)), bias


def preview(mi, image, path, scale):
    mi.util.write_bitmap(str(path), mi.Bitmap((image * scale).astype(np.float32)))


def measure(args, mi, home, kept, scene, radiances):
    size, threads = tuple(args.size), args.threads
    true = list(sky.TRUE)
    ours = player.Player(args.relight, args.work / "relight", threads)
    made = {"truth": {}, "relight": {}, "radiance": {}, "mitsuba": {}}
    traced = tracer.Tracer(mi, scene)
    theirs = radiance.Radiance(home, scene, args.work / f"radiance_{scene.name}") if home else None
    for view in scene.views:
        name = f"{scene.name} {view.name}"
        halves = array(
            args.work / f"truth_{scene.name}_{view.name}.npy",
            lambda: traced.truth(view, size, STEP, radiances[true], args.spp, 2),
        )
        made["truth"][view.name] = [errors.noise(halves[:, i]) for i in range(len(true))]

        def held(folder, ending):
            images = [tracer.read(mi, folder / ending.format(frame)) for frame in true]
            for frame, image in zip(true, images):
                scale = 0.25 / halves[:, true.index(frame)].mean()
                preview(mi, image, args.work / f"{name} {frame} {folder.name}.png", scale)
            images = [image[::STEP, ::STEP] for image in images]
            count, share = errors.in_the_dark(images[0], halves[:, 0])
            if count and share:
                print(f"{name}, {folder.name}: {count} pixels that show nothing have {share:.0%} of the mean.", file=sys.stderr)
            return judged(images, halves)

        for frame in range(len(true)):
            shown = halves[:, frame].mean(axis=0)
            preview(mi, shown, args.work / f"{name} {true[frame]} truth.png", 0.25 / shown.mean())

        for preset in args.presets:

            out = f"{scene.name}_{view.name}_{preset}"

            def play():
                once, each = ours.frames(ours.asset(scene, preset), view, size, out, DAYS)
                return {"once": once, "each": each}

            bake = kept.step(f"{scene.name}: bake {preset}", lambda: ours.bake(scene, preset))
            took = kept.step(f"{name}: play {preset}", play)
            played = took | {"found": held(ours.folder / out, "{:04}.exr")}
            made["relight"].setdefault(preset, {"bake": bake})[view.name] = played
        for rays in RAYS if theirs else ():

            out = f"{view.name}_c{rays}"

            def flux():
                once = theirs.images(view, size, FLUX.split(), rays, out, threads)
                return {"once": once, "each": theirs.frames(out, radiances, f"{out}_frames") / sky.FRAMES}

            took = kept.step(f"{name}: rfluxmtx -c {rays}", flux)
            added = took | {"found": held(theirs.folder / f"{out}_frames", "{:03}.hdr")}
            made["radiance"].setdefault(rays, {})[view.name] = added

        def path():
            # Once before, for what is compiled at first.
            traced.rendered(view, size, radiances[true[0]], 1, 1)
            images, took = zip(*[traced.rendered(view, size, radiances[f], args.path_spp, 2) for f in true])
            np.save(paths, images)
            return {"each": float(np.mean(took))}

        paths = args.work / f"path_{scene.name}_{view.name}.npy"
        took = kept.step(f"{name}: path", path)
        made["mitsuba"][view.name] = took | {"found": judged(np.load(paths)[:, ::STEP, ::STEP], halves)}
    return made


def number(value, deviation=None):
    """With as many digits as its standard error leaves."""
    if deviation is None:
        return f"{value:.2g}"
    digits = int(min(max(np.ceil(-np.log10(deviation)), 1), 4))
    return f"{value:.{digits}f} ± {deviation:.{digits}f}"


def cells(found):
    row = []
    for kind in ("overcast", "sun"):
        error, deviation, bias = of_kind(found, kind)
        row += [number(error, deviation), f"{100 * bias:+.1f} %"]
    return row


def tables(args, made):
    rows, days = [], []
    for scene, all_of in made.items():
        for view in all_of["truth"]:
            noise = {
                kind: np.mean([n for n, k in zip(all_of["truth"][view], sky.TRUE.values()) if k == kind])
                for kind in ("overcast", "sun")
            }
            row = [f"{scene}, {view}", "truth", "", "", ""]
            rows.append([*row, number(noise["overcast"]), "", number(noise["sun"]), ""])
            for preset, of in all_of["relight"].items():
                got = of[view]
                each = "" if got["each"] is None else f"{1000 * got['each']:.0f}"
                row = ["", f"relight, {preset}", f"{of['bake']:.0f}", f"{got['once']:.0f}", each]
                rows.append([*row, *cells(got["found"])])
            for rays, of in all_of["radiance"].items():
                got = of[view]
                row = ["", f"Radiance, -c {rays}", "", f"{got['once']:.0f}", f"{1000 * got['each']:.0f}"]
                rows.append([*row, *cells(got["found"])])
            got = all_of["mitsuba"][view]
            row = ["", f"Mitsuba, {args.path_spp} samples", "", "", f"{1000 * got['each']:,.0f}"]
            rows.append([*row, *cells(got["found"])])
        for preset, of in all_of["relight"].items():
            days += equal(scene, preset, of, all_of)
    head = "scene, view | program | bake, CPU s | view, CPU s | frame, CPU ms | overcast: relMSE | bias | with sun: relMSE | bias"
    print(table(head, rows))
    head = "scene, preset | sky | relight, CPU s | Radiance, CPU s | of that | Mitsuba, CPU s | of that"
    print(table(head, days))


def equal(scene, preset, of, all_of):
    """A day in two views: relight, and the others where their noise alone is relight's relMSE."""
    views, rows = [view for view in of if view != "bake"], []
    ours = of["bake"] + sum(of[v]["once"] + sky.FRAMES * (of[v]["each"] or 0) for v in views)
    for kind in ("overcast", "sun"):
        theirs = paths = 0
        for view in views:
            error = of_kind(of[view]["found"], kind)[0]
            if all_of["radiance"]:
                few, many = (all_of["radiance"][rays][view] for rays in RAYS)
                errors_of = [of_kind(got["found"], kind)[0] for got in (few, many)]
                # relMSE = noise / rays + what more rays don't mend.
                noise = (errors_of[0] - errors_of[1]) / (1 / RAYS[0] - 1 / RAYS[1])
                a_ray = (many["once"] - few["once"]) / (RAYS[1] - RAYS[0])
                theirs += a_ray * noise / error + sky.FRAMES * many["each"]
            got = all_of["mitsuba"][view]
            paths += sky.FRAMES * got["each"] * of_kind(got["found"], kind)[0] / error
        rows.append(
            [f"{scene}, {preset}", kind, f"{ours:,.0f}"]
            + ([f"{theirs:,.0f}", f"1/{theirs / ours:.0f}"] if theirs else ["", ""])
            + [f"{paths:,.0f}", f"1/{paths / ours:.0f}"]
        )
    return rows


def table(head, rows):
    lines = [f"| {head} |", "|" + " --- |" * len(head.split("|"))]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--relight", type=pathlib.Path, required=True, help="the program, a release build")
    parser.add_argument("--sponza", type=pathlib.Path, help="sponza_dabrovic.glb; without it the room alone")
    parser.add_argument("--work", type=pathlib.Path, help="folder for all that is made; what is there is not made again")
    parser.add_argument("--size", nargs=2, type=int, default=(320, 180), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--presets", nargs="+", default=PRESETS, help="relight's")
    parser.add_argument("--spp", type=int, default=SPP, help="samples of each half of the truth")
    parser.add_argument("--path-spp", type=int, default=PATH_SPP, help="samples of Mitsuba's own path tracer")
    parser.add_argument("--threads", type=int, default=2)
    args = parser.parse_args()
    args.relight = args.relight.resolve()
    args.work = (args.work or pathlib.Path(tempfile.mkdtemp())).resolve()
    args.work.mkdir(parents=True, exist_ok=True)

    mi, home = tracer.find(), radiance.find()
    if mi is None:
        sys.exit("Mitsuba 3 is missing, or an LLVM for it (pip install mitsuba; libllvm19 did): there is no truth without.")
    if home is None:
        print("Radiance is missing (pip install pyradiance): left out.", file=sys.stderr)
    kept = Kept(args.work / "measured.json")
    ours = player.Player(args.relight, args.work / "relight", args.threads)
    radiances = array(args.work / "sky.npy", lambda: ours.sky(lambda path: tracer.read(mi, path)))
    made = {}
    played = [scenes.sponza(args.sponza)] if args.sponza else []
    for scene in [*played, scenes.room()]:
        made[scene.name] = measure(args, mi, home, kept, scene, radiances)
    tables(args, made)


if __name__ == "__main__":
    main()
