"""Damaged scenes and results are a result or one clear error: a mutator with planted seeds."""

import random
import shutil

import pytest
from mutations import judged, mutated
from tiny_scene import HINGE, MOTION, TEMPLATE, write_tiny_scene

from vtkmuscle import Scene

LANDMARKS = "x,y,z\n" + "".join(f"{x},{y},34.0\n" for x, y in [(4, 0), (0, 4), (-4, 0), (0, -4), (4, 0)])
RING = "[[4, 0, -34], [0, 4, -34], [-4, 0, -34], [0, -4, -34], [4, 0, -34]]"

#: Which file is damaged, and what is put into the scene for it.
KINDS = {
    "scene.toml": {},
    "scene.toml with a hinge": {MOTION: HINGE},
    "motion.csv": {},
    "landmarks.csv": {"attachments/origin.vtp": "landmarks.csv"},
    "landmarks.json": {"attachments/insertion.vtp": "landmarks.json"},
    "template.toml": {'template = "parallel"': 'template_file = "template.toml"'},
    "attachments/origin.vtp": {},
    "muscles/spindle.vtp": {},
    "bones/upper.vtp": {},
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    scene = write_tiny_scene(tmp_path_factory.mktemp("whole") / "scene")
    (scene.parent / "landmarks.csv").write_text(LANDMARKS)
    (scene.parent / "landmarks.json").write_text(RING)
    (scene.parent / "template.toml").write_text(TEMPLATE)
    return scene.parent


def damaged_scenes(folder, whole, kind, count):
    """Write damaged scenes of a kind, each in a folder of its own, and return their files."""
    name, text = kind.split(" ")[0], (whole / "scene.toml").read_text()
    for old, new in KINDS[kind].items():
        assert old in text
        text = text.replace(old, new)
    for seed in range(count):
        own = folder / f"{seed} {kind.replace('/', ' ')}"
        shutil.copytree(whole, own)
        (own / "scene.toml").write_text(text)
        (own / name).write_bytes(mutated((own / name).read_bytes(), seed))
        yield own / "scene.toml"


def test_damaged_scenes_are_a_result_or_one_clear_error(whole, tmp_path, pytestconfig, tried):
    count = 150 if pytestconfig.getoption("--long") else 2
    kinds = {path: kind for kind in KINDS for path in damaged_scenes(tmp_path, whole, kind, count)}
    judged(kinds, "load_and_run", "a damaged {}, read and run", tried)


@pytest.mark.slow
def test_a_run_goes_on_from_damaged_results_or_says_one_clear_error(whole, tmp_path, pytestconfig, tried):
    shutil.copytree(whole, tmp_path / "scene")
    Scene.load(tmp_path / "scene/scene.toml").run(tmp_path / "whole", frames="0:2", figures=False)
    kinds = {}
    for seed in range(300 if pytestconfig.getoption("--long") else 3):
        out = tmp_path / f"{seed}"
        shutil.copytree(tmp_path / "whole", out)
        files = sorted(path for path in out.rglob("*") if path.is_file())
        file = random.Random(seed).choice(files)
        file.write_bytes(mutated(file.read_bytes(), seed))
        kinds[out] = f"{file.suffix} of results"
    judged(kinds, "go_on", "a run that goes on from a damaged {}", tried)
