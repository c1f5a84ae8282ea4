"""Every command that reads files, given damaged ones: a result, or lines of error that say what is wrong."""

import json
import random
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from fuzz_target import WORDS
from mutations import judged, mutated
from phantoms import hip, label_map
from tiny_scene import HINGE, MOTION, write_tiny_scene
from two_joint_scene import OPENSIM, save_strap, scene_with

from vtkmuscle import Scene
from vtkmuscle.data.arrays import blocks_of, points_of
from vtkmuscle.io import write_polydata
from vtkmuscle.opensim import export

sys.path.insert(0, str(Path(__file__).parent / "io"))
from test_damaged_texts import KINDS as TEXTS

LITERATURE = "source,muscle,dof,angle_deg,moment_arm_mm,part\n" + "".join(
    f"Somebody1985,spindle,hinge,{angle},{15.5 + 0.1 * angle},{part}\n"
    for part in ("lower_bound", "upper_bound", "")
    for angle in (0, 10, 20)
)
#: Joints of a model of OpenSim.
LEG = OPENSIM | {"model": "4.osim", "rest": {"knee_angle": 0.0}}
MESHES = ("Pelvis.vtp", "Femur R.vtp", "Iliacus R.vtp", "Iliacus R_origin.csv")
RESULTS = "results/**/*"

#: What is given to a command, which of its files may be damaged, and how many are in the long form.
COMMANDS = {
    "info": (["info", *TEXTS], [*TEXTS], 100),
    "info of results": (["info", "results"], ["results/*"], 60),
    "info that draws": (["info", "F.fcsv", "--draw", "drawn.png"], ["F.fcsv"], 10),
    "run with a model of OpenSim": (
        ["run", "moved/scene.toml", "--out", "out", "--frames", "0:1", "--no-figures"],
        ["moved/4.osim", "moved/walk.mot", "moved/scene.toml"],
        90,
    ),
    "report": (["report", "results", "--literature", "published.csv"], [RESULTS, "published.csv"], 60),
    "compare": (
        ["compare", "results", "others", "--literature", "published.csv"],
        [RESULTS, "published.csv"],
        60,
    ),
    "figures": (["figures", "results"], [RESULTS], 15),
    "export to OpenSim": (["export", "joints", "joints.osim", "--groups", "2"], ["joints/**/*"], 60),
    "export to MuJoCo": (["export", "joints", "joints.xml"], ["joints/**/*"], 60),
    "export into a model": (
        ["export", "joints", "more.osim", "--into", "into.osim", "--replace", "strap=strap"],
        ["into.osim"],
        60,
    ),
    "check": (["check", "4.osim"], ["4.osim"], 100),
    "from-labels": (
        ["from-labels", "map.nrrd", "--out", "drawn", "--names", "names.csv"],
        ["map.nrrd", "names.csv"],
        60,
    ),
    "init": (["init", *(f"meshes/{name}" for name in MESHES), "--out", "drawn"], ["meshes/*"], 60),
}


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """A folder of all that commands are given."""
    folder, made = tmp_path_factory.mktemp("given"), tmp_path_factory.mktemp("made")
    scene = write_tiny_scene(folder / "scene")
    scene.write_text(scene.read_text().replace(MOTION, HINGE.lstrip() + "\n"))
    for name in ("results", "others"):
        Scene.load(scene).run(folder / name, frames="0:3", figures=False)
    save_strap(made / "strap", n_fibres=4)
    grid = {"grid": {"upper": [-10, 10, 10], "lower": [0, 20, 10]}}
    strap = Scene.load(scene_with(made / "strap", made / "gridded", motion=grid, deformer="none"))
    strap.run(folder / "joints", figures=False)
    export(folder / "joints", folder / "into.osim")
    for path, content in TEXTS.items():
        (folder / path).write_bytes(content)
    changes = {"joints": None, "opensim": LEG, "motion": {"file": "walk.mot"}, "deformer": "none"}
    moved = scene_with(made / "strap", made / "moved", **changes).parent.rename(folder / "moved")
    shutil.copy(folder / "4.osim", moved), shutil.copy(folder / "walk.mot", moved)
    (folder / "published.csv").write_text(LITERATURE)
    whole = hip()
    parts = {**dict(blocks_of(whole.bones)), **whole.muscles}
    for name, part in zip(MESHES, (parts[name] for name in ("pelvis", "femur", "iliacus")), strict=False):
        write_polydata(folder / "meshes" / name, part)
    origin = points_of(dict(blocks_of(whole.attachments["iliacus"]))["origin_0"])
    np.savetxt(folder / "meshes" / MESHES[-1], origin, delimiter=",")
    names = ["pelvis", "femur_right", *(f"{name}_right" for name in whole.muscles)]
    (folder / "names.csv").write_text(
        "label,name\n" + "".join(f"{number},{name}\n" for number, name in enumerate(names, start=1))
    )
    image = label_map(whole, spacing=6.0)
    size, voxels = image.GetDimensions(), np.asarray(image.GetPointData().GetScalars(), dtype=np.uint8)
    head = f"NRRD0004\ntype: uchar\ndimension: 3\nsizes: {size[0]} {size[1]} {size[2]}\nencoding: raw\n"
    head += "space: left-posterior-superior\nspace directions: (6,0,0) (0,6,0) (0,0,6)\n\n"
    (folder / "map.nrrd").write_bytes(head.encode() + voxels.tobytes())
    return folder


def cases(folder, given, name, count):
    """Copy what is given, with one of the files damaged, and say what the command is."""
    words, patterns, _ = COMMANDS[name]
    files = sorted({path for one in patterns for path in given.glob(one) if path.is_file()})
    for seed in range(count):
        own = folder / f"{seed} {name}"
        shutil.copytree(given, own)
        file = own / random.Random(seed).choice(files).relative_to(given)
        file.write_bytes(mutated(file.read_bytes(), seed))
        (own / WORDS).write_text(json.dumps(words))
        yield own


def test_commands_on_damaged_files_end_in_a_result_or_lines_of_error(given, tmp_path, pytestconfig, tried):
    part = 1 if pytestconfig.getoption("--long") else 60
    kinds = {
        path: name
        for name, (*_, count) in COMMANDS.items()
        for path in cases(tmp_path, given, name, count // part)
    }
    judged(kinds, "command", "{}, of damaged files", tried)
    if part == 1:
        assert all(tried.rows[f"{name}, of damaged files"]["used"] for name in COMMANDS)
