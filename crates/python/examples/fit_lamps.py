"""Finds the intensities of lamps that come nearest to a picture: light is linear, so it is a problem of least squares.

    python fit_lamps.py hall.relight --size 640 360 --target wanted.exr

Without a target, one is made of lamps whose intensities are kept secret, with noise on it, and the answer is held against them.
"""

import argparse

import numpy as np
import relight

RNG = np.random.default_rng(1)


def lamps_in(asset, count=4):
    """Lamps of 1 W/sr in the open: in front of points of the asset."""
    points = asset.points
    chosen = RNG.choice(len(points), count, replace=False)
    away = 0.05 * np.ptp(points.positions, axis=0).max()
    places = points.positions[chosen] + away * points.normals[chosen]
    return [relight.Point(position=place, intensity=1.0, name=f"lamp{i}") for i, place in enumerate(places)]


def fitted(basis, target, rounds=30):
    """Non-negative intensities by least squares: lamps that would have to shine darkness are switched off, one after another."""
    columns, wanted = basis.reshape(len(basis), -1).T.astype(float), target.ravel().astype(float)
    shining = np.arange(len(basis))
    for _ in range(rounds):
        weights = np.zeros(len(basis))
        weights[shining] = np.linalg.lstsq(columns[:, shining], wanted, rcond=None)[0]
        if weights.min() >= 0:
            break
        shining = np.setdiff1d(shining, [weights.argmin()])
    return weights


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("asset")
    parser.add_argument("--size", nargs=2, type=int, default=(160, 90), metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--target", help="an OpenEXR file of that size")
    args = parser.parse_args()
    asset = relight.open(args.asset)
    shot = asset.shot(size=tuple(args.size))
    lamps = lamps_in(asset)
    basis = shot.basis(lamps)
    if args.target:
        secret, target = None, relight.read_exr(args.target)["beauty"]
    else:
        secret = RNG.uniform(0.0, 5.0, len(lamps))
        target = np.tensordot(secret, shot.basis(lamps, seed=1), axes=1)
        target *= RNG.normal(1.0, 0.02, target.shape)
    weights = fitted(basis, target)
    for i, weight in enumerate(weights):
        known = "" if secret is None else f"   (in truth {secret[i]:.3f})"
        print(f"lamp{i}: {weight:.3f} W/sr{known}")
    mixed = np.tensordot(weights, basis, axes=1)
    error = np.sqrt(((mixed - target) ** 2).mean() / (target**2).mean())
    print(f"The picture is missed by {error:.1%}.")
    relight.write_exr("fitted.exr", {"beauty": mixed, "target": target})
    if secret is not None:
        # Of lamps that light nothing in the picture it says nothing.
        brightness = basis.reshape(len(basis), -1).mean(axis=1)
        seen = brightness > 0.05 * brightness.max()
        assert seen.sum() > 1 and np.allclose(weights[seen], secret[seen], rtol=0.05, atol=0.05), "the lamps are not found"


if __name__ == "__main__":
    main()
