import numpy as np
import pytest
from shapes import lines_of

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.data.arrays import cell_array, field_array, points_of, polylines_of, surface_from
from vtkmuscle.data.attachments import AttachmentArea, attachments_from, attachments_of
from vtkmuscle.filters.fibre_template_source import FibreTemplateSource
from vtkmuscle.filters.template_fitter import TemplateFitter
from vtkmuscle.phantoms.meshing import box

ROLES = ("origin", "insertion")


def template(kind="parallel"):
    return FibreTemplateSource(template=kind, n_fibres=5, resolution=4).update().output


def transform_of(fitted):
    return np.array(field_array(fitted, "Transform")).reshape(4, 4)


def axis_of(fitted):
    axis = transform_of(fitted)[:3, 2]
    return axis / np.linalg.norm(axis)


def centroids(attachments):
    areas = attachments_of(attachments, "test")
    return [
        np.vstack([a.landmarks for a in areas if a.role == role]).mean(axis=0)
        for role in ("origin", "insertion")
    ]


def test_fibres_and_areas_are_transformed_and_arrays_pass_through(spindle):
    cube = template("fan")
    fitted = TemplateFitter()(cube, spindle.muscles["spindle"], spindle.attachments["spindle"])
    transform = transform_of(fitted)
    expected = apply_transform(transform, polylines_of(cube, "test").points)
    assert np.allclose(polylines_of(fitted, "test").points, expected, atol=1e-12)
    for name in ("OriginArea", "InsertionArea"):
        expected = apply_transform(transform, np.array(field_array(cube, name)))
        assert np.allclose(field_array(fitted, name), expected, atol=1e-12)
    for name in ("r", "s", "FibreId"):
        assert np.array_equal(cell_array(fitted, name, "test"), cell_array(cube, name, "test"))
    assert field_array(fitted, "FitError").shape == (1,)


def test_the_box_is_right_handed_and_runs_from_origin_to_insertion(hip):
    for name, muscle in hip.muscles.items():
        (uneven := template()).GetFieldData().RemoveArray("Template")
        fitted = TemplateFitter()(uneven, muscle, hip.attachments[name])
        transform = transform_of(fitted)
        assert np.linalg.det(transform[:3, :3]) > 0
        local = np.linalg.solve(transform[:3, :3], (points_of(muscle) - transform[:3, 3]).T)
        assert local.min() > -1e-9
        assert local.max() < 1 + 1e-9
        origin, insertion = centroids(hip.attachments[name])
        direction = (insertion - origin) / np.linalg.norm(insertion - origin)
        assert np.allclose(axis_of(fitted), direction, atol=1e-12)


def test_auto_takes_the_axis_with_the_smaller_error(hip, block):
    for phantom in (hip, block):
        for name, muscle in phantom.muscles.items():
            errors = {
                axis: field_array(
                    TemplateFitter(axis=axis)(template(), muscle, phantom.attachments[name]), "FitError"
                )[0]
                for axis in ("auto", "attachments", "principal")
            }
            assert errors["auto"] == min(errors.values())


def test_fibres_that_run_across_the_long_axis_are_found():
    # A board 20 x 40 x 120 whose attachments are its long narrow sides: fibres run along y.
    points, triangles = box((0, 0, 0), (20, 40, 120), 5.0)
    sides = [np.array([(0.0, y, 0), (20, y, 0), (20, y, 120), (0, y, 120)]) for y in (0, 40)]
    areas = attachments_from(
        [AttachmentArea(role, "bone", side, True) for role, side in zip(ROLES, sides, strict=True)]
    )
    muscle = surface_from(points, triangles)
    fitted = TemplateFitter()(template(), muscle, areas)
    assert field_array(fitted, "FitError")[0] == pytest.approx(0, abs=1e-9)
    assert np.allclose(np.abs(axis_of(fitted)), (0, 1, 0))
    assert field_array(TemplateFitter(axis="principal")(template(), muscle, areas), "FitError")[0] > 100


def test_coinciding_centroids_do_not_stop_auto(spindle):
    ((name, muscle),) = spindle.muscles.items()
    areas = attachments_of(spindle.attachments[name], "test")
    both = [AttachmentArea(role, "bone", areas[0].landmarks, True) for role in ROLES]
    for axis in ("auto", "principal"):
        fitted = TemplateFitter(axis=axis)(template(), muscle, attachments_from(both))
        assert np.isfinite(points_of(fitted)).all()


# ------------------------------------------------------------------------------- superficial fibres


def leaning_lines(side, slope):
    """Return lines on the front of a block (y = 0) that lean to one side of it."""
    z = np.linspace(10.0, 45.0, 4)
    return lines_of([np.column_stack([x + side * slope * (z - 10), 0 * z, z]) for x in (16.0, 20.0, 24.0)])


def square_block():
    points, triangles = box((0, 0, 0), (40, 40, 120), 5.0)
    corners = np.array([(0.0, 0, 0), (40, 0, 0), (40, 40, 0), (0, 40, 0)])
    ends = [
        AttachmentArea("origin", "a", corners, closed=True),
        AttachmentArea("insertion", "b", np.add(corners, [0, 0, 120]), closed=True),
    ]
    return surface_from(points, triangles), attachments_from(ends)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_arched_fibres_arch_to_the_side_that_was_seen(side):
    # The landmarks of a square block suit a box with its x axis to any of four sides.
    cube = FibreTemplateSource(template="curved", n_fibres=200, resolution=15).update().output
    x_axis = transform_of(TemplateFitter()(cube, *square_block(), leaning_lines(side, 0.2)))[:3, 0]
    assert np.allclose(x_axis / np.linalg.norm(x_axis), [side, 0, 0], atol=1e-9)
