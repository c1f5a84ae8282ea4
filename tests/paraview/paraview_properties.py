"""Run by pvpython: what proxies look like from ParaView's side, refused values, abort. Argument: folder."""

import sys
from pathlib import Path

import paraview.simple as pv
from paraview import servermanager
from paraview_pipeline import pipeline_of_proxies
from scene_on_disk import TIMES, points

from vtkmuscle.paraview.proxies import camel_case, clean
from vtkmuscle.paraview.shells import all_kinds


def check_declarations():
    """ParaView takes the XML of every filter: its properties, inputs, menu and help (see test_proxies.py)."""
    manager = servermanager.ProxyManager()
    for kind in all_kinds():
        proxy = manager.NewProxy("filters" if kind.input_ports else "sources", kind.__name__)
        assert proxy.GetHints().FindNestedElementByName("ShowInMenu").GetAttribute("category") == "Muscle"
        assert proxy.GetDocumentation().GetDescription().startswith(clean(kind.__doc__.partition("\n")[0]))
        for name, parameter in kind.parameter_declarations.items():
            shown = proxy.GetProperty(camel_case(name))
            assert clean(parameter.doc) in shown.GetDocumentation().GetDescription()
            if parameter.kind in (int, float, str) and parameter.default is not None:
                assert shown.GetElement(0) == parameter.default, (kind, name)
        for port in kind.input_ports:
            assert proxy.GetProperty(camel_case(port.name)).GetClassName() == "vtkSMInputProperty"


def check_refusal(chain):
    """A value that is refused fails with the reason, and is forgotten when it is replaced."""
    tubes = pv.FibreTubes(Fibres=chain["fitted"])
    tubes.Radius = -3.0
    tubes.UpdatePipeline()
    assert tubes.GetDataInformation().GetNumberOfPoints() == 0
    tubes.Radius = 1.0
    tubes.UpdatePipeline()
    assert tubes.GetDataInformation().GetNumberOfPoints() > 0


def check_abort(chain):
    """A deformer that is told to stop does so at the next iteration, and works again afterwards."""
    deformed = chain["deformed"]
    deformed.UpdatePipeline(TIMES[0])
    before = points(servermanager.Fetch(deformed))
    algorithm = deformed.GetClientSideObject()
    reached = []

    def stop(caller, _event):
        reached.append(caller.GetProgress())
        if 0.0 < reached[-1] < 1.0:
            caller.SetAbortExecute(1)

    observer = algorithm.AddObserver("ProgressEvent", stop)
    rounds = int(deformed.Iterations)
    deformed.Iterations = rounds + 1
    deformed.UpdatePipeline(TIMES[0])
    # VTK itself says 0.0 before the filter begins and 1.0 after it has stopped, for each output apart.
    assert len(set(reached) - {0.0, 1.0}) == 1, reached
    assert algorithm.GetOutputDataObject(0).GetNumberOfPoints() == 0
    algorithm.RemoveObserver(observer)
    deformed.Iterations = rounds
    deformed.UpdatePipeline(TIMES[0])
    assert points(servermanager.Fetch(deformed)) == before


def check_scene(folder, chain):
    """File, Open on a scene.toml gives what the files it names hold, and feeds the filters."""
    scene = pv.OpenDataFile(str(folder / "scene/scene.toml"))
    assert scene.GetXMLName() == "MuscleScene"
    muscle, bones, attachments = (pv.OutputPort(scene, name) for name in ("Surface", "Bones", "Attachments"))
    fixed = pv.FixedPointDetector(Muscle=muscle, Bones=bones, Attachments=attachments)
    moving = pv.BoneMotion(Bones=bones, Motion=str(folder / "scene/scene.toml"))
    posed = {"RestBones": bones, "Bones": moving}
    paths = pv.TautPaths(RestFibres=chain["smoothed"], RestMuscle=fixed, **posed)
    deformed = pv.PathDeformer(Muscle=fixed, Paths=paths, **posed)
    results = []
    for last in (deformed, chain["deformed"]):
        last.UpdatePipeline(TIMES[0])
        results.append(points(servermanager.Fetch(last)))
    assert len(results[0]) > 100
    assert results[0] == results[1]


def main(folder):
    check_declarations()
    chain = pipeline_of_proxies(folder)
    check_scene(folder, chain)
    check_refusal(chain)
    check_abort(chain)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
