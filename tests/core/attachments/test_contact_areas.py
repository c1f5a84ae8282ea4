from __future__ import annotations

import numpy as np
import pytest

from vtkmuscle.core.attachments.contact_areas import attached_ends, contact_areas, outline
from vtkmuscle.core.mesh.normals import triangle_normals

LONG, WIDE = 60, 12


def strip():
    """Return a flat strip in z = 0: 60 by 12 squares of 1 mm, each of two triangles."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(LONG + 1.0), np.arange(WIDE + 1.0), indexing="ij"))
    i = (np.arange(LONG)[:, None] * (WIDE + 1) + np.arange(WIDE)).ravel()
    right = i + WIDE + 1
    triangles = np.vstack([np.column_stack([i, right, right + 1]), np.column_stack([i, right + 1, i + 1])])
    return np.column_stack([x, y, np.zeros_like(x)]), triangles


STRIP = strip()
X, Y = STRIP[0][:, 0], STRIP[0][:, 1]


def test_contacts_are_connected_and_noise_is_left_out():
    touching = [(X < 10) | ((X > 20) & (X < 26)) | ((X == 40) & (Y == 5)), np.zeros(len(X), dtype=bool)]
    large, small = contact_areas(*STRIP, touching)
    assert (large.bone, small.bone) == (0, 0)
    np.testing.assert_array_equal(large.points, np.flatnonzero(X < 10))
    np.testing.assert_array_equal(small.points, np.flatnonzero((X > 20) & (X < 26)))
    assert large.area == pytest.approx(9.5 * WIDE)
    assert small.area == pytest.approx(5.0 * WIDE)


def contacts_of(touching):
    """Return the contacts of both ends."""
    return [end.contacts for end in attached_ends(*STRIP, contact_areas(*STRIP, touching))]


def test_attachments_are_at_the_ends_not_where_the_muscle_slides():
    """The second bone touches the muscle in its middle, more than at its end."""
    touching = [X < 15, ((X > 25) & (X < 40)) | (X > 54)]
    first, second = contacts_of(touching)
    assert [contact.bone for contact in first] == [0]
    np.testing.assert_array_equal(first[0].points, np.flatnonzero(X < 15))
    assert [contact.bone for contact in second] == [1]
    np.testing.assert_array_equal(second[0].points, np.flatnonzero(X > 54))


def test_of_a_long_contact_the_far_part_is_the_attachment():
    touching = [X <= 30, X >= 55]
    first, _ = contacts_of(touching)
    np.testing.assert_array_equal(first[0].points, np.flatnonzero(X <= 22))  # 0.6 * 55 mm from x = 55


def test_areas_at_one_end_are_one_attachment():
    touching = [(X < 8) & (np.abs(Y - 6) > 2), X > 50]
    larger, smaller = contacts_of(touching)
    assert [contact.bone for contact in larger] == [1]
    assert [contact.bone for contact in smaller] == [0, 0]


def test_of_three_bones_the_two_at_the_ends_are_chosen():
    touching = [X < 8, (X > 20) & (X < 40), X > 50]
    first, second = contacts_of(touching)
    assert {first[0].bone, second[0].bone} == {0, 2}


def test_one_bone_makes_no_pair():
    assert attached_ends(*STRIP, contact_areas(*STRIP, [X < 8])) is None


def test_a_bone_that_the_muscle_passes_is_not_taken_however_large_the_contact():
    """As semimembranosus lies on the femur's condyle, and rectus femoris on its shaft."""
    touching = [X < 2, (X > 6) & (X < 52), X > 56]
    first, second = contacts_of(touching)
    assert {first[0].bone, second[0].bone} == {0, 2}


def test_an_end_is_surer_the_farther_out_and_the_less_another_bone_rivals_it():
    far = attached_ends(*STRIP, contact_areas(*STRIP, [X < 8, X > 52]))
    near = attached_ends(*STRIP, contact_areas(*STRIP, [(X > 12) & (X < 20), X > 52]))
    assert min(end.sureness for end in far) > 0.9
    sure = {end.contacts[0].bone: end.sureness for end in near}
    assert sure[0] < 0.85 < sure[1]
    rivals = attached_ends(*STRIP, contact_areas(*STRIP, [X < 8, (X > 44) & (X < 51), X > 52]))
    sure = {end.contacts[0].bone: end.sureness for end in rivals}
    assert sure[2] < 0.4


def test_the_outline_of_a_patch_goes_round_it_once():
    hole = (np.abs(X - 20) < 2) & (np.abs(Y - 6) < 2)
    ring, closed = outline(*STRIP, np.flatnonzero((X >= 10) & (X <= 30) & ~hole))
    assert closed
    assert 8 <= len(ring) <= 40
    steps = np.linalg.norm(ring - np.roll(ring, -1, axis=0), axis=1)
    assert steps.max() < 1.5 * steps.min()
    arms = ring - ring.mean(axis=0)
    area = np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)) / 2
    assert area == pytest.approx(20 * WIDE, rel=0.05)


def test_a_patch_without_triangles_is_its_points_in_order():
    line = np.flatnonzero((Y == 6) & (X < 5))
    points, closed = outline(*STRIP, line[[3, 0, 4, 2, 1]])
    assert not closed
    assert list(points[:, 0]) in ([0, 1, 2, 3, 4], [4, 3, 2, 1, 0])


def test_parts_that_hang_on_one_point_are_left_out():
    bow_tie = ((X <= 10) & (Y >= 6)) | ((X >= 10) & (X <= 12) & (Y >= 4) & (Y <= 6))
    ring, closed = outline(*STRIP, np.flatnonzero(bow_tie))
    assert closed
    kept = STRIP[1][bow_tie[STRIP[1]].all(axis=1)]
    assert np.linalg.norm(triangle_normals(STRIP[0], kept), axis=1).sum() / 2 == pytest.approx(64.0)
    assert ring[:, 0].max() <= 10.5
