"""Relights a scene through a day: one camera, one sky that moves, a frame for each hour.

    python day.py hall.relight --size 640 360

Writes day.exr, a layer for each hour, and says what each took.
"""

import argparse
import time

import numpy as np
import relight

HOURS = np.arange(6, 19)


def sun_at(hour):
    """Towards the sun: it rises in +X, stands 50° high at noon, and sets in -X."""
    around, height = np.pi * (hour - 6) / 12, np.radians(50)
    return np.array([np.cos(around), np.sin(around) * np.sin(height) + 0.02, np.sin(around) * np.cos(height)])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("asset")
    parser.add_argument("--size", nargs=2, type=int, default=(640, 360), metavar=("WIDTH", "HEIGHT"))
    args = parser.parse_args()
    asset = relight.open(args.asset)
    shot = asset.shot(size=tuple(args.size))
    # A key for each hour: what is prepared of a sky is prepared once.
    sky = relight.SunSky(sun_direction=relight.Keys([(i, sun_at(hour)) for i, hour in enumerate(HOURS)]), turbidity=3)
    lights = asset.lights([sky])
    day = {}
    for i, hour in enumerate(HOURS):
        start = time.perf_counter()
        frame = shot.frame(lights, time=i)
        took = time.perf_counter() - start
        beauty = frame["beauty"]
        day[f"{hour:02}h"] = beauty
        share = frame["indirect"].mean() / max(beauty.mean(), 1e-9)
        print(f"{hour:02}:00  mean radiance {beauty.mean():9.3f} W/(m² sr), {share:4.0%} of it indirect, {1e3 * took:5.0f} ms")
    relight.write_exr("day.exr", day)
    print("Wrote day.exr.")


if __name__ == "__main__":
    main()
