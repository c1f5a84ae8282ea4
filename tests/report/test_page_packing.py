"""Arrays of a page."""

import numpy as np
import pytest
from packed_arrays import array_of, moving_of, unpacked

from vtkmuscle.report.scene3d import STEPS, Pack


def test_arrays_come_out_as_they_went_in(rng):
    pack = Pack()
    values = {
        "u8": rng.integers(0, 256, 7),
        "i8": rng.integers(-128, 128, 5),
        "u16": rng.integers(0, 65536, 3),
        "u32": rng.integers(0, 2**32, 4),
        "f32": rng.random(6).astype(np.float32),
    }
    places = {kind: pack.add(array, kind) for kind, array in values.items()}
    data = unpacked(pack.text())
    for kind, array in values.items():
        np.testing.assert_array_equal(array_of(data, places[kind]), array)
        assert places[kind]["at"] % 4 == 0, "a page's arrays of 32 bits begin at a multiple of four bytes"


@pytest.mark.parametrize("frames", [1, 2, 3, 40])
def test_moving_points_come_out_within_half_a_step(frames, rng):
    start, velocity = rng.normal(size=(2, 50, 3)) * [300.0, 20.0, 1.0]
    jumps = rng.normal(size=(frames, 50, 3)) * 40.0
    points = start + velocity * np.arange(frames)[:, None, None] + jumps
    pack = Pack()
    place = pack.add_moving(points)
    step = np.ptp(points, axis=(0, 1)).max() / STEPS
    error = np.abs(moving_of(unpacked(pack.text()), place) - points).max()
    assert error <= 0.5 * step * (1 + 1e-6)
    assert place["step"] == pytest.approx(step)
