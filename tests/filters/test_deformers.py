"""What paths and deformers have in common: bones at rest, fixed points, presets."""

import numpy as np
import pytest
from filter_case import Case, other_value

from examples import fixed_muscle, rest_bones
from vtkmuscle.data.arrays import add_arrays, blocks_of
from vtkmuscle.filters import PathDeformer, PBDDeformer, TautPaths

every_deformer = pytest.mark.parametrize("kind", [TautPaths, PathDeformer, PBDDeformer])


@pytest.mark.parametrize(
    "change",
    [
        lambda bones: {f"{name}_r": bone for name, bone in bones.items()},
        lambda bones: dict(reversed(bones.items())),
    ],
    ids=["names", "order"],
)
@every_deformer
def test_bones_at_rest_of_other_names_or_order_are_refused(kind, change):
    case = Case(kind)
    deformer = case.filter(*case.inputs())
    deformer.rest_bones = change(dict(blocks_of(rest_bones())))
    message = f"{kind.__name__}: rest_bones: the blocks are .*, but the moving bones are"
    with pytest.raises(ValueError, match=message):
        deformer.update()


@every_deformer
def test_a_muscle_without_fixed_points_is_refused(kind):
    case, port = Case(kind), "rest_muscle" if kind is TautPaths else "muscle"
    deformer, muscle = case.filter(*case.inputs()), fixed_muscle()
    deformer.connect(port, add_arrays(muscle, points={"FixedTo": np.full(muscle.GetNumberOfPoints(), -1)}))
    with pytest.raises(ValueError, match=f"{kind.__name__}: {port}: no point is fixed to a bone"):
        deformer.update()


@every_deformer
def test_a_preset_is_its_values_and_an_explicit_value_counts_more(kind):
    declared, defaults = kind.parameter_declarations, kind().parameters()
    for quality, values in declared["quality"].sets.items():
        made, later = kind(quality=quality), kind()
        later.quality = quality
        assert made.parameters() == {**defaults, "quality": quality, **values} == later.parameters()
        assert kind(**made.parameters()).parameters() == made.parameters()
        for name, value in values.items():
            own = other_value(declared[name], value)
            assert getattr(kind(quality=quality, **{name: own}), name) == own
    with pytest.raises(ValueError, match=r"quality is 'best', but must be one of 'preview', 'balanced'"):
        kind(quality="best")
