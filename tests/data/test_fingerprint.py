import numpy as np
import pytest

from vtkmuscle.data.fingerprint import fingerprint


@pytest.mark.parametrize("size", [0, 1, 3, 4, 5, 17, 1000])
def test_equal_arrays_have_equal_fingerprints_and_others_have_not(size):
    values = np.random.default_rng(0).random((size, 3))
    assert fingerprint(values) == fingerprint(values.copy()) == fingerprint(np.asfortranarray(values))
    seen = {fingerprint(values)}
    for i in range(values.size):  # the last bit of any number counts
        other = values.copy().reshape(-1)
        other[i] = np.nextafter(other[i], 2.0)
        seen.add(fingerprint(other.reshape(values.shape)))
    assert len(seen) == values.size + 1


def test_order_shape_and_type_count():
    values = np.arange(24.0)
    others = [values[::-1], values.reshape(4, 6), values.astype(np.float32), values.astype(np.int64), -values]
    assert len({fingerprint(array) for array in [values, *others]}) == 6
    assert fingerprint(values, values[:3]) != fingerprint(values[:3], values)


def test_bytes_that_fill_no_word_count():
    values = np.arange(13, dtype=np.uint8)
    assert fingerprint(values) != fingerprint(np.append(values[:-1], np.uint8(99)))
