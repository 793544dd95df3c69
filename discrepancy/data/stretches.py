"""Stretches of samples that are marked one after another."""

import numpy as np
from numpy.typing import NDArray


def stretches(marked: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where those of ``marked`` (n,) begin and end, as [begin, end), in their order."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], marked, [False])).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in edges.reshape(-1, 2)]
