"""Damaged models, motions and landmarks are a result or one clear error: never a hang, a NaN, a traceback."""

import json
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import osim_texts as texts
import pytest
import test_io_msf as trees

from vtkmuscle.io import read_landmarks, read_msf
from vtkmuscle.io.xml_elements import read_xml
from vtkmuscle.opensim import read_motion_file, read_osim

sys.path.insert(0, str(Path(__file__).parents[1]))
from mutations import mutated

MOTION = "walk\nversion=1\nnRows=4\nnColumns=3\ninDegrees=yes\n\nwords\nendheader\ntime\tknee_angle\thip_x\n"
MOTION += "".join(f"{0.1 * i:.2f}\t{7 * i}\t{-2.5 * i}\n" for i in range(4))
CONTROLS = [{"id": str(i), "label": f"F-{i}", "position": [i, 2.5, -3.0 * i]} for i in range(4)]
MARKUPS = {"markups": [{"type": "Curve", "coordinateSystem": "LPS", "controlPoints": CONTROLS}]}
NRRD = b"NRRD0004\ntype: double\nsizes: 3 3\nencoding: raw\nendian: little\n\n" + np.arange(9.0).tobytes()
FCSV = "# CoordinateSystem = LPS\n# columns = id,x,y,z,label\n1,2,3,4,a\n2,3,4,5,b\n3,4,5,7,c\n"

COUPLER = """<CoordinateCouplerConstraint name="c"><coupled_coordinates_function>
<LinearFunction><coefficients>2 0.1</coefficients></LinearFunction></coupled_coordinates_function>
<independent_coordinate_names>knee_angle</independent_coordinate_names>
<dependent_coordinate_name>hip_x</dependent_coordinate_name></CoordinateCouplerConstraint>"""
FORCES = texts.muscle(texts.MOVING) + texts.muscle(texts.CONDITIONAL).replace("vastus", "rectus")

KINDS = {
    "4.osim": texts.model_4(forces=FORCES, constraints=COUPLER).encode(),
    "3.osim": texts.model_3().encode("latin-1"),
    "walk.mot": MOTION.encode(),
    "walk.sto": MOTION.replace("inDegrees=yes", "inDegrees=no\nDataType=double").encode(),
    "F.mrk.json": json.dumps(MARKUPS).encode(),
    "F.fcsv": FCSV.encode(),
    "F.nrrd": NRRD,
    "hip.msf": trees.WHOLE.encode(),
}


def use(path):
    """Read a file, and do with it what a scene does; return numbers."""
    if path.suffix == ".osim":
        model = read_osim(path)
        sweep = {name: np.linspace(-1, 1, 5) for name in model.tree.free}
        lengths = [one.path.lengths(model.tree, sweep) for one in model.muscles.values()]
        return [*model.tree.poses(sweep).values(), *lengths]
    if path.suffix == ".msf":
        return [position for cloud in read_msf(path).values() for position in cloud.values()]
    if path.suffix in (".mot", ".sto"):
        return [read_motion_file(path).table]
    return [read_landmarks(path)[0]]


@pytest.mark.parametrize("name", KINDS)
def test_damaged_files_are_a_result_or_one_clear_error(tmp_path, name, pytestconfig, tried):
    count = 500 if pytestconfig.getoption("--long") else 60
    path = tmp_path / name
    used, refused = 0, []
    for seed in range(count):
        path.write_bytes(mutated(KINDS[name], seed))
        began = time.perf_counter()
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=".*the header says.*")
            warnings.filterwarnings("ignore", message=".*decimals with a point.*")
            try:
                found = use(path)
            except ValueError as error:
                refused.append(str(error))
                tried.add(f"a damaged {path.suffix}, read", "refused")
                continue
        assert all(np.isfinite(one).all() for one in found), seed
        assert time.perf_counter() - began < 5.0, seed
        used += 1
        tried.add(f"a damaged {path.suffix}, read", "used")
    assert 0 < used < count
    assert all(refused)


def test_a_file_without_damage_is_used(tmp_path):
    for name, content in KINDS.items():
        (tmp_path / name).write_bytes(content)
        assert use(tmp_path / name)


def test_large_xml_files_are_read(tmp_path):
    (tmp_path / "a.osim").write_text("<a>" + 100_000 * "x<b/>" + "</a>")
    assert len(read_xml(tmp_path / "a.osim").text) == 100_000
