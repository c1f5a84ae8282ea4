"""Everything moved by one rigid transform gives the same results, moved: the whole chain."""

import numpy as np
import pytest
from phantoms import fibre_block
from slow import slow

from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform, inverse, rotation_about
from vtkmuscle.data.arrays import blocks_of, multiblock_from, points_of, with_points
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.pipelines import decompose, deform

MOVE = rotation_about((30.0, -20.0, 5.0), (1.0, 2.0, -0.5), 73.0)
MOVE[:3, 3] += (250.0, -1300.0, 75.0)


def moved(data):
    return with_points(data, apply_transform(MOVE, points_of(data)))


def moved_blocks(data):
    return multiblock_from({name: moved(block) for name, block in blocks_of(data)})


def moved_motion(motion):
    tables = {bone: MOVE @ table @ inverse(MOVE) for bone, table in motion.transforms.items()}
    return RigidMotion(motion.times, tables, apply_transform(MOVE, motion.centre[None])[0])


def results(muscle, bones, motion, attachments, time):
    """Return the points of the deformed muscle and of its fibres."""
    fibres = decompose(muscle, attachments, n_fibres=20)
    deformer = deform(muscle, bones, motion, attachments, fibres=fibres, iterations=5)
    transport = FibreTransport()
    for port, value in enumerate((fibres, muscle, deformer)):
        transport.connect(port, value)
    carried = points_of(transport.update(time=time).output)
    return points_of(deformer.update(time=time).output), carried


@pytest.mark.parametrize("name", ["iliacus", *slow("gluteus_medius")])
def test_the_hip_moved_rigidly_deforms_as_before(hip, name):
    muscle, attachments = hip.muscles[name], hip.attachments[name]
    here = results(muscle, hip.bones, hip.motion, attachments, 10.0)
    there = results(
        moved(muscle), moved_blocks(hip.bones), moved_motion(hip.motion), moved_blocks(attachments), 10.0
    )
    for before, after in zip(here, there, strict=True):
        assert np.abs(apply_transform(MOVE, before) - after).max() < 1e-6  # mm


def test_fibres_of_a_block_do_not_depend_on_how_it_is_turned():
    """Straight fibres, samples and walls side by side: ties everywhere."""
    phantom = fibre_block("parallel")
    muscle, attachments = phantom.muscles["block"], phantom.attachments["block"]
    here = points_of(decompose(muscle, attachments).update().output)
    there = points_of(decompose(moved(muscle), moved_blocks(attachments)).update().output)
    assert np.abs(apply_transform(MOVE, here) - there).max() < 1e-6  # mm
