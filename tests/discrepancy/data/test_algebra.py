"""Inverses of gram matrices, against those of plain ones."""

import numpy as np

from discrepancy.data.algebra import inverse_scaled


def test_columns_of_any_size_have_the_inverse_that_theirs_have_at_one() -> None:
    columns = np.random.default_rng(1).standard_normal((40, 4))
    plain, size = columns.T @ columns, np.array([1e-140, 1.0, 1e6, 1e140])
    found = inverse_scaled(plain * size[:, None] * size)
    np.testing.assert_allclose(found * size[:, None] * size, np.linalg.inv(plain), rtol=1e-10)


def test_what_is_dead_or_beyond_all_numbers_gets_zero_and_nothing_else() -> None:
    columns = np.random.default_rng(2).standard_normal((40, 4))
    plain = columns.T @ columns
    for dead in (0.0, np.inf, np.nan):
        gram = plain.copy()
        gram[2], gram[:, 2] = dead, dead
        found, rest = inverse_scaled(gram), [0, 1, 3]
        np.testing.assert_allclose(found[np.ix_(rest, rest)], np.linalg.inv(plain[np.ix_(rest, rest)]), rtol=1e-10)
        # The rounding of a direction that is left out.
        assert np.abs(found[2]).max() < 1e-15
