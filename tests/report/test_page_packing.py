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


def test_smooth_motion_takes_little_room(rng):
    """A frame is told by how much it differs from where the two before it lead to."""

    def size(points):
        pack = Pack()
        pack.add_moving(points)
        return len(pack.text())

    turn = np.linspace(0, 1.5, 50)[:, None]
    circle = rng.random((1, 2000, 3)) * 200.0
    x, y, z = circle[..., 0], circle[..., 1], circle[..., 2]
    smooth = np.stack(
        [np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z + 0 * turn], -1
    )
    rough = smooth + rng.normal(size=smooth.shape) * 20.0
    assert size(smooth) < 0.3 * size(rough)
    assert size(smooth) < 1.2 * smooth.size, "not more than a byte or so per coordinate"


def test_the_same_arrays_give_the_same_text():
    texts = set()
    for _ in range(2):
        pack = Pack()
        pack.add(np.arange(100), "u16")
        texts.add(pack.text())
    assert len(texts) == 1
