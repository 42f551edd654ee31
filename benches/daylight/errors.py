"""How far images are from a truth that is noisy itself."""

import numpy as np

# Part of the squared mean of the truth that keeps dark pixels from deciding, as in `relight compare`.
FLOOR = 0.01


def weights(truth):
    """Of each pixel: one over its grey, squared, and a part of the image's."""
    grey = truth.mean(axis=-1)
    return 1 / (grey**2 + FLOOR * grey.mean() ** 2)


def relmse(image, halves):
    """relMSE against the mean of two truths that are noisy independently, and its standard error.

    The product of the differences from both has no part of their noise in its mean; so no pixel is left out, which `relight compare`
    does with the worst 0.1 %."""
    product = ((image - halves[0]) * (image - halves[1])).mean(axis=-1) * weights(np.mean(halves, axis=0))
    return product.mean(), product.std() / np.sqrt(product.size)


def noise(halves):
    """relMSE of the mean of both truths against what they would be without noise."""
    squares = ((halves[0] - halves[1]) ** 2).mean(axis=-1) / 4
    return (squares * weights(np.mean(halves, axis=0))).mean()


def bias(image, halves):
    """Relative error of the mean."""
    return image.mean() / np.mean(halves) - 1
