"""A phantom's scene as files for ParaView and plain Python, and the pipeline over it in plain Python."""

from vtkmuscle import Scene, filters
from vtkmuscle.data.arrays import points_of
from vtkmuscle.io import read_polydata, write_motion_table, write_polydata
from vtkmuscle.scene.reading import read_motion

#: Pipeline times that are asked for [degrees]; the last lies between two steps of the motion.
TIMES = (2.0, 4.0, 7.0)
N_FIBRES, RADIUS = 20, 0.8


def write(folder, phantom):
    """Write a phantom's muscle as .vtp, bones and attachments as .vtm, the motion as scene and table."""
    import pyvista

    ((name, muscle),) = phantom.muscles.items()
    write_polydata(folder / "muscle.vtp", muscle)
    for file, blocks in (("bones", phantom.bones), ("attachments", phantom.attachments[name])):
        pyvista.wrap(blocks).save(folder / f"{file}.vtm")
    Scene.from_phantom(phantom).save(folder / "scene")
    write_motion_table(folder / "motion.csv", phantom.motion)


def pipeline(made, muscle, bones, attachments, motion):
    """Return a chain of filters by the names of its results; they are made by name, with inputs by port."""
    moving = made("BoneMotion", bones=bones, motion=motion)
    fixed = made("FixedPointDetector", muscle=muscle, bones=bones, attachments=attachments)
    template = made("FibreTemplateSource", n_fibres=N_FIBRES)
    fitted = made("TemplateFitter", template=template, muscle=muscle, attachments=attachments)
    morphed = made("SliceMorpher", template=fitted, muscle=muscle)
    trimmed = made("FibreTrimmer", fibres=morphed, muscle=muscle, attachments=attachments)
    smoothed = made("FibreSmoother", fibres=trimmed)
    posed = {"rest_bones": bones, "bones": moving}
    paths = made("TautPaths", rest_fibres=smoothed, rest_muscle=fixed, **posed)
    deformed = made("PathDeformer", muscle=fixed, paths=paths, **posed)
    carried = made("FibreTransport", rest_fibres=smoothed, rest_muscle=muscle, deformed_muscle=deformed)
    measured = made("FibreMetrics", fibres=carried)
    return {
        "moving": moving,
        "fixed": fixed,
        "smoothed": smoothed,
        "paths": paths,
        "deformed": deformed,
        "template": template,
        "fitted": fitted,
        "morphed": morphed,
        "carried": carried,
        "measured": measured,
        "tubes": made("FibreTubes", fibres=measured, radius=RADIUS),
    }


def made_in_python(name, **values):
    """Return a filter with inputs and parameters."""
    kind = getattr(filters, name)
    ports = {port.name: number for number, port in enumerate(kind.input_ports)}
    algorithm = kind(**{key: value for key, value in values.items() if key not in ports})
    for key in ports.keys() & values.keys():
        algorithm.connect(ports[key], values[key])
    return algorithm


def pipeline_in_python(folder):
    """Return the chain over a folder that was written."""
    import pyvista

    return pipeline(
        made_in_python,
        read_polydata(folder / "muscle.vtp"),
        pyvista.read(folder / "bones.vtm"),
        pyvista.read(folder / "attachments.vtm"),
        read_motion(folder / "scene/scene.toml"),
    )


def points(data):
    """Return the points of a data set, or of all blocks one after the other."""
    if data.IsA("vtkMultiBlockDataSet"):
        return [p for i in range(data.GetNumberOfBlocks()) for p in points_of(data.GetBlock(i)).tolist()]
    return points_of(data).tolist()


def results(chain):
    """Return the points of every filter of a chain at each of TIMES."""
    found = {}
    for time in TIMES:
        for name, algorithm in chain.items():
            found[f"{name} at {time:g}"] = points(algorithm.update(time).output)
    return found
