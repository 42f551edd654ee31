"""Sparse matrices as compressed rows."""

from typing import NamedTuple, Tuple

import numpy as np


class CSR(NamedTuple):
    """A sparse matrix as scipy has them: the entries of row i are ``data[indptr[i]:indptr[i + 1]]``, their columns
    ``indices[indptr[i]:indptr[i + 1]]``. ``scipy.sparse.csr_array(m[:3], shape=m.shape)`` takes it as it is.

    Entries of ``links["transfer"]`` are vectors: ``data`` is ``(n, 3)``, one matrix for each of x, y and z.
    """

    data: np.ndarray
    indices: np.ndarray
    indptr: np.ndarray
    shape: Tuple[int, int]
