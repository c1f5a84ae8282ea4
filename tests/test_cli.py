"""The command line: one clear error, exit status, and nothing lost at Ctrl-C."""

import contextlib
import json
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import pyvista
import typer
from commands import python, refused, vtkmuscle_
from slow import slow
from tiny_scene import HINGE, MOTION, edit, ellipsoid

import vtkmuscle
from vtkmuscle import Scene
from vtkmuscle.cli import options
from vtkmuscle.cli.options import Status, one_clear_error, stop_if_interrupted
from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of
from vtkmuscle.io import write_motion_table, write_polydata

#: The command line, where this process ignores Ctrl-C too (as in the background of a shell).
STOPPABLE = """
import signal
from vtkmuscle.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)
main()
"""
#: The command line, with Ctrl-C as it loads a module.
STOPPED_AS_IT_LOADS = """
import sys
from vtkmuscle.cli import main

class Stop:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            sys.meta_path.remove(self)
            raise KeyboardInterrupt

sys.meta_path.insert(0, Stop())
main()
"""


def test_version():
    assert vtkmuscle_("--version").stdout == f"vtkmuscle {vtkmuscle.__version__}\n"


def test_help_fills_its_lines():
    assert "limit of the deformer, and to published" in vtkmuscle_("tradeoff", "--help").output


def test_help_names_the_commands_without_loading_vtk():
    code = "import sys; from vtkmuscle.cli import main; sys.argv = ['vtkmuscle', '--help']\n"
    code += "try: main()\nfinally: assert not {'vtkmodules', 'numba', 'pyvista'} & set(sys.modules)"
    printed = python("-c", code).stdout
    assert all(command in printed for command in ("run", "demo", "info"))


def test_a_run_says_what_it_found_and_where_it_is(scene_file, tmp_path):
    done = vtkmuscle_("run", scene_file, "--out", tmp_path / "out", "--frames", "0:2", "--no-figures")
    assert "spindle: 2 frames, volume within " in done.stdout
    assert str(tmp_path / "out") in done.stdout
    assert json.loads((tmp_path / "out/report.json").read_text())["frames"] == [0, 1]


def test_without_out_the_folder_is_called_after_the_scene(scene_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = vtkmuscle_("run", scene_file, "--frames", "0:1", "--no-figures", "--quiet")
    assert done.output == ""
    assert (tmp_path / "tiny_out/spindle.pvd").is_file()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('bone = "upper"', 'bone = "uper"', "muscles.spindle.attachments[0].bone: there is no bone 'uper'"),
        ("muscles/spindle.vtp", "muscles/no.vtp", "muscles.spindle.surface: there is no such file"),
        ("iterations", "iteration", "solver.iteration: there is no such key"),
    ],
)
def test_bad_input_is_one_line_and_status_2(old, new, message, scene_file, tmp_path):
    edit(scene_file, old, new)
    said = refused("run", scene_file, "--out", tmp_path / "out")
    assert message in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_frames_and_folders_that_cannot_be_are_status_2(scene_file, tmp_path):
    call = "run", scene_file, "--quiet", "--out"
    assert "5 frames; give A:B or A:B:STEP, 0" in refused(*call, tmp_path / "out", "--frames", "9:3")
    assert "is a file; give another folder" in refused(*call, scene_file)
    refused("run", tmp_path / "no.toml")
    vtkmuscle_("run", status=Status.BAD_INPUT)


def test_a_failing_filter_is_status_2_and_names_the_muscle(scene_file, tmp_path):
    scene_file.write_text(scene_file.read_text() + '\n[fixing]\nmethod = "proximity"\ndistance = 1e-9\n')
    said = refused("run", scene_file, "--out", tmp_path / "out", "--quiet")
    assert "muscles.spindle: FixedPointDetector: no point of the muscle" in said


def test_a_warning_is_one_line(scene_file, tmp_path):
    path = scene_file.parent / "muscles/spindle.vtp"
    muscle = ellipsoid((8, 8, 40), (0, 0, 0), 16)
    write_polydata(path, surface_from(points_of(muscle), triangles_of(muscle, "muscle")[:, ::-1]))
    done = vtkmuscle_("run", scene_file, "--out", tmp_path / "out", "--frames", "0", "-q", "--no-figures")
    assert done.stderr.startswith("warning: ")
    assert "inside out" in done.stderr
    assert done.stderr.count("\n") == 1


def test_info_says_what_a_mesh_is(scene_file, tmp_path):
    open_ball = ellipsoid((30, 30, 30), (0, 0, 0))
    write_polydata(
        tmp_path / "open.vtp", surface_from(points_of(open_ball), triangles_of(open_ball, "x")[1:])
    )
    done = vtkmuscle_(
        "info",
        scene_file.parent / "muscles/spindle.vtp",
        tmp_path / "open.vtp",
        scene_file.parent / "attachments/origin.vtp",
    )
    assert "Scene('tiny': spindle; bones upper, lower" in vtkmuscle_("info", scene_file).stdout
    spindle, open_, ring = done.stdout.split(str(tmp_path))[1:]
    assert "closed      yes" in spindle
    assert "manifold    yes" in spindle
    assert "outward" in spindle
    assert "probably mm" in spindle
    assert "closed      no, 3 edges have one triangle" in open_
    assert "volume      none, it is open" in open_
    assert "polylines   1" in ring


def test_info_says_and_draws_what_it_understood_of_landmarks(tmp_path):
    (tmp_path / "origin.csv").write_text("name,x,y,z\nA,0,0,0\nB,30,0,0\nC,30,40,0\nA,0,0,0\n")
    said = vtkmuscle_("info", tmp_path / "origin.csv", "--draw", tmp_path / "origin.png").stdout
    assert ("yes, 120 round" in said, "A, B, C" in said) == (True, True)
    assert (tmp_path / "origin.png").read_bytes().startswith(b"\x89PNG")
    words = "origin.jpg: unknown format of a picture; allowed: png, pdf, svg"
    assert words in refused("info", tmp_path / "origin.csv", "--draw", tmp_path / "origin.jpg")


def test_info_says_what_it_understood_of_a_motion(tmp_path):
    (tmp_path / "walk.mot").write_text("w\ninDegrees=yes\nendheader\ntime knee\n0 1\n1 60\n")
    assert "degrees\n  columns     knee (1 .. 60)" in vtkmuscle_("info", tmp_path / "walk.mot").stdout
    model = '<Model><Ground name="g"/><MarkerSet><objects><Marker name="asis"/></objects></MarkerSet></Model>'
    (tmp_path / "m.osim").write_text(f'<OpenSimDocument Version="40000">{model}</OpenSimDocument>')
    assert "asis" in vtkmuscle_("info", tmp_path / "m.osim").stdout
    write_motion_table(tmp_path / "knee.csv", hinge("tibia", (0, 0, 0), (1, 0, 0), [0, 10]))
    assert vtkmuscle_("info", tmp_path / "knee.csv").stdout.split()[1:5] == ["poses", "2", "bones", "tibia"]
    assert "results: there is no such file" in refused("info", tmp_path / "results")


def test_ctrl_c_that_a_callback_swallows_ends_the_command_later(monkeypatch):
    monkeypatch.setattr(options, "_pressed", threading.Event())
    with pytest.raises(typer.Exit) as ended, one_clear_error(None):  # noqa: PT012
        with contextlib.suppress(KeyboardInterrupt):
            options.interrupt()
        stop_if_interrupted()
    assert ended.value.exit_code == 130


@pytest.mark.parametrize("moment", ["in the middle", *slow("at the start")])
def test_ctrl_c_leaves_the_finished_frames(moment, scene_file, tmp_path):
    scene_file.write_text(
        scene_file.read_text().replace(MOTION, HINGE.replace("[0, 20, 5]", "[0, 90, 0.05]"))
    )
    out = tmp_path / "out"
    command = [sys.executable, "-c", STOPPABLE, "run", scene_file, "--out", out, "--no-figures"]
    sign = out / "spindle/spindle_0003.vtp" if moment == "in the middle" else out
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        deadline = time.monotonic() + 120
        while not sign.exists() and child.poll() is None and time.monotonic() < deadline:
            time.sleep(0.01)
        child.send_signal(signal.SIGINT)
        try:
            _, errors = child.communicate(timeout=60)
        finally:
            child.kill()
    assert child.returncode == 130, errors
    assert "stopped. " in errors
    assert "Traceback" not in errors
    assert not [path for path in out.rglob("*") if "partial" in path.name]
    if moment == "in the middle":
        assert "contains an unfinished run (KeyboardInterrupt); finished frames: spindle" in errors
        reader = pyvista.get_reader(out / "spindle.pvd")
        assert len(reader.time_values) >= 3
        for value in reader.time_values:
            reader.set_active_time_value(value)
            assert reader.read()[0].n_points
        report = json.loads((out / "report.json").read_text())
        assert report["complete"] is False
        assert report["stopped_by"] == "KeyboardInterrupt"


@pytest.mark.parametrize("module", ["numba.core.types.misc", *slow("vtkmuscle.run.muscles")])
def test_ctrl_c_while_libraries_are_loaded_is_one_line(module, scene_file, tmp_path):
    (tmp_path / "out").mkdir()
    command = [sys.executable, "-c", STOPPED_AS_IT_LOADS.format(module=module), "run", scene_file]
    done = subprocess.run([*command, "--out", tmp_path / "out"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.strip()) == (130, "stopped. Nothing was written.")


def test_the_demo_writes_a_scene_that_can_be_run_again(tmp_path, monkeypatch):
    # A smaller phantom than the hip.
    monkeypatch.setattr(vtkmuscle.phantoms, "hip", lambda **_: vtkmuscle.phantoms.spindle_over_hinge())
    refused("demo", "--out", tmp_path / "my demo", "--muscle", "psoas")
    assert not (tmp_path / "my demo").exists()
    done = vtkmuscle_("demo", "--out", tmp_path / "my demo", "--frames", "0:2", "--no-figures")
    path = tmp_path / "my demo/scene/scene.toml"
    assert f"vtkmuscle run '{path}'" in done.stdout
    report = json.loads((tmp_path / "my demo/report.json").read_text())
    assert report["complete"] is True
    again = vtkmuscle.Scene.load(path).run(frames="0:2", figures=False)
    for name, muscle in again.report["muscles"].items():
        assert muscle["fibres"] == report["muscles"][name]["fibres"]
        assert [row["volume_ratio"] for row in muscle["frames"]] == [
            row["volume_ratio"] for row in report["muscles"][name]["frames"]
        ]


def test_a_fault_of_the_package_is_one_line_with_its_traceback_in_a_file(monkeypatch, scene_file):
    """Also after a Ctrl-C, which loading a module turns into an error: then the command has stopped."""

    def broken(*_):
        raise KeyError("odd")

    monkeypatch.setattr(Scene, "load", broken)
    done = vtkmuscle_("run", scene_file, status=Status.FAULT)
    assert len(done.stderr.splitlines()) == 1
    assert "error: a fault of vtkmuscle: KeyError: 'odd'; the traceback is in " in done.stderr
    assert "in broken" in Path(done.stderr.split("traceback is in ")[1].split(",")[0]).read_text()
    monkeypatch.setattr(options, "_pressed", threading.Event())
    monkeypatch.setattr(Scene, "load", lambda *_: (options._pressed.set(), broken()))
    assert vtkmuscle_("run", scene_file, status=130).stderr == "stopped. Nothing was written.\n"
