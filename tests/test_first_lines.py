"""What somebody who knows PyVista, VTK or pandas types first: it works, or says what to write."""

import numpy as np
import pytest
import pyvista as pv

import vtkmuscle
from vtkmuscle import Scene, filters, phantoms
from vtkmuscle.plotting import can_render

#: Each line, and what it gives: "" where it works, else what the one error says.
LINES = {
    "vtkmuscle.Scenes": "did you mean 'Scene'",
    "vtkmuscle.AttachmentArea('origin', 'fixed', np.eye(3), True)": "",
    "Result.load('nowhere')": "nowhere",
    "scene['spindle']": "",
    "scene['distal'].plot(off_screen=True)": "",
    "scene['spindel']": "did you mean 'spindle'",
    "scene.plot(show=False, off_screen=True).close()": "",
    "scene.plot(muscles='spindle', show=False, off_screen=True).close()": "",
    "scene['spindle'].points[:2]": "",
    "scene.run(muscles=['spindle'], quality='preview', n_fibres=4, frames='0')": "",
    "scene.run(n_fibre=4)": "did you mean 'n_fibres'",
    "[*scene, len(scene), 'spindle' in scene]": "",
    "[*result, len(result), 'spindle' in result, dict(result.items())]": "",
    "result['spindle'].volume / result['spindle'].length": "",
    "result['spindle'].plot(show=False, off_screen=True).close()": "",
    "result.muscle('spindle', frame=-1)": "",
    "result.muscle('spindle', time=2.4)": "",
    "result.verdict": "did you mean 'verdicts'",
    "filters.FiberSmoother": "did you mean 'FibreSmoother'",
    "result.n_frames": "write len(frames)",
    "result['spindle'].pcsa": "architecture['pcsa_mm2']",
    "scene.export": "write vtkmuscle.export",
    "result._repr_html_()": "",
    "scene.run(outdir='out')": "no option 'outdir'",
    "vtkmuscle.PBDDeformer": "vtkmuscle.filters.PBDDeformer",
    "vtkmuscle.from_label": "did you mean 'from_labels'",
    "[vtkmuscle.init, vtkmuscle.export, vtkmuscle.check, vtkmuscle.fetch]": "",
    "Muscle('spindle.stl')": "pyvista.read(path)",
    "Muscle(mesh, [('origin', 'fixed', np.eye(3), True)]).attachments[0].role": "",
    "vtkmuscle.hinge(centre=(0, 0, 0), axis=(1, 0, 0), angles=[0, 30])": "bone",
    "vtkmuscle.hinge('shank', (0, 0, 0), 'x', [0, 30])": "have a length, but is 'x'; e.g. (1, 0",
    "result['spindle'].lengths": "",
    "result['spindle'].moment_arms['distal_angle'].mean, result['spindle'].architecture['pcsa_mm2']": "",
    "result['spindle'].moment_arms['angle']": "did you mean 'distal_angle'",
    "result['spindle'].surface(frame=1).points": "",
    "result['spindel']": "did you mean 'spindle'",
    "result.muscles['spindle'].verdict": "",
    "result.muscle('spindle', frame=1).plot(off_screen=True)": "",
    "result.lengths['spindle'].mean(axis=1)": "",
    "[result.to_csv(folder), result.length_table().to_csv(folder / 'a.csv')]": "",
    "result.length_table()['length']": "the table has no column 'length'; did you mean 'length_mm'",
    "result.length_table().to_frame().groupby('fibre').length_mm.mean()": "",
    "result.architecture()['pcsa_mm2']": "",
    "[result.to_frame(), result.moment_arms()['spindle']]": "",
    "result.length_table().columns": "write list(table)",
    "result.moment_arms('spindle')": "no coordinate 'spindle'",
    "result.plot(muscles='spindle', show=False, off_screen=True).close()": "",
    "result.plot(muscles='spindel')": "did you mean 'spindle'",
    "result.write_figures(folder, form='jpg')": "png, pdf, svg",
    "result.write_report('page.pdf')": "in .html",
    "smoother.SetSmoothingPasses(3)": "did you mean 'smoothing_passes'",
    "smoother.GetPasses()": "allowed: smoothing_passes",
    "smoother.smothing_passes = 3": "did you mean 'smoothing_passes'",
    "filters.FibreSmoother(passes=3)": "smoothing_passes",
    "filters.FibreSmoother(fibres)": "FibreSmoother()(data)",
    "smoother(fibres)": "",
    "smoother.SetInputData(fibres)": "",
    "smoother.GetOutput()": "",
    "plotting.plot_lengths(result.times, result.lengths['spindle'])": "",
}


@pytest.fixture(scope="module")
def known(tmp_path_factory):
    scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
    fibres = filters.FibreTemplateSource(n_fibres=4)()
    return {
        **{name: getattr(vtkmuscle, name) for name in vtkmuscle.__all__},
        "vtkmuscle": vtkmuscle,
        "np": np,
        "scene": scene,
        "result": scene.run(frames="0:3"),
        "mesh": pv.Sphere(),
        "fibres": fibres,
        "folder": tmp_path_factory.mktemp("out"),
        "smoother": filters.FibreSmoother(fibres=fibres),
    }


@pytest.mark.parametrize("line", LINES)
def test_a_line_works_or_says_what_to_write(known, line):
    if "off_screen" in line and (reason := can_render()):
        pytest.skip(reason)
    if "to_frame" in line:
        pytest.importorskip("pandas", reason="pandas is not installed")
    words = LINES[line]
    if not words:
        exec(line, dict(known))
        return
    with pytest.raises((AttributeError, KeyError, TypeError, ValueError)) as raised:
        exec(line, dict(known))
    assert words in str(raised.value)
    assert len(str(raised.value)) < 500


SHOWN = "scene scene.muscles result result.lengths result.fibre_lengths result.muscles result.moment_arms() "
SHOWN += "result.moment_arms()['spindle'] result.architecture()"


@pytest.mark.parametrize("what", SHOWN.split())
def test_what_a_prompt_shows_is_short(known, what):
    assert 10 < len(repr(eval(what, dict(known)))) < 1500


def test_what_is_asked_for_is_what_the_run_has(known):
    result = known["result"]
    one = result["spindle"]
    np.testing.assert_array_equal(one.lengths, result.lengths["spindle"])
    np.testing.assert_array_equal(one.surface(frame=2).points, result.muscle("spindle", frame=2).points)
    assert one.architecture["pcsa_mm2"] == float(result.architecture()["pcsa_mm2"][0])
    assert isinstance(known["scene"]["spindle"], pv.PolyData)


def test_a_plot_keeps_the_users_backend(known, monkeypatch):
    pytest.importorskip("IPython", reason="PyVista takes a backend for notebooks where there are notebooks")
    monkeypatch.setattr(pv.global_theme, "jupyter_backend", "static")
    plotter = known["scene"].plot(show=False, off_screen=True)
    assert plotter.theme.jupyter_backend == "static"
    plotter.close()


def test_literature_is_laid_over_by_one_option(known, tmp_path):
    table = tmp_path / "published.csv"
    table.write_text("source,muscle,dof,angle_deg,moment_arm_mm\nA1999,spindle,distal_angle,5,30\n")
    with_it = known["result"].with_literature(table)
    assert [curve.source for curve in with_it.literature["spindle"]] == ["A1999"]
    assert not known["result"].literature.get("spindle")
    table.write_text("source,muscle,dof,angle_deg,moment_arm_mm\nA1999,psoas,hip,5,30\n")
    with pytest.raises(ValueError, match="muscles in the file: psoas"):
        known["result"].with_literature(table)
    table.write_text("source,muscle,dof,angle_deg,moment_arm_mm\nA1999,spindle,hip,5,30\n")
    with pytest.raises(ValueError, match="no moment arms by distal_angle; dof in the file: hip"):
        known["result"].with_literature(table)
    with pytest.raises(ValueError, match="no moment arms by distal_angle; dof in the file: hip"):
        vtkmuscle.compare([known["result"]] * 2, literature=table)
