"""A phantom's scene as files for ParaView and plain Python, and the pipeline over it in plain Python."""

from vtkmodules.vtkIOXML import vtkXMLMultiBlockDataReader, vtkXMLMultiBlockDataWriter

from vtkmuscle import Scene
from vtkmuscle.filters import (
    BoneMotion,
    FibreMetrics,
    FibreSmoother,
    FibreTemplateSource,
    FibreTransport,
    FibreTrimmer,
    FibreTubes,
    FixedPointDetector,
    PBDDeformer,
    SliceMorpher,
    TemplateFitter,
)
from vtkmuscle.filters.arrays import points_of
from vtkmuscle.io import read_polydata, write_polydata
from vtkmuscle.scene.reading import read_motion

#: Pipeline times that are asked for [degrees]; the last lies between two steps of the motion.
TIMES = (2.0, 4.0, 7.0)
N_FIBRES, RADIUS = 20, 0.8


def write(folder, phantom):
    """Write the phantom's only muscle as .vtp, its bones and attachments as .vtm, its motion as a scene."""
    ((name, muscle),) = phantom.muscles.items()
    write_polydata(folder / "muscle.vtp", muscle)
    for file, blocks in (("bones", phantom.bones), ("attachments", phantom.attachments[name])):
        writer = vtkXMLMultiBlockDataWriter()
        writer.SetFileName(str(folder / f"{file}.vtm"))
        writer.SetInputData(blocks)
        assert writer.Write() == 1
    Scene.from_phantom(phantom).save(folder / "scene")


def blocks(path):
    reader = vtkXMLMultiBlockDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutputDataObject(0)


def connected(kind, *inputs, **parameters):
    made = kind(**parameters)
    for port, value in enumerate(inputs):
        made.connect(port, value)
    return made


def pipeline(folder):
    """Return the chain that paraview_pipeline.py builds, as filters by the names of its results."""
    muscle = read_polydata(folder / "muscle.vtp")
    bones, attachments = blocks(folder / "bones.vtm"), blocks(folder / "attachments.vtm")
    moving = connected(BoneMotion, bones, motion=read_motion(folder / "scene/scene.toml"))
    fixed = connected(FixedPointDetector, muscle, bones, attachments)
    deformed = connected(PBDDeformer, fixed, moving)
    template = FibreTemplateSource(n_fibres=N_FIBRES)
    fitted = connected(TemplateFitter, template, muscle, attachments)
    morphed = connected(SliceMorpher, fitted, muscle)
    trimmed = connected(FibreTrimmer, morphed, muscle, attachments)
    smoothed = connected(FibreSmoother, trimmed)
    carried = connected(FibreTransport, smoothed, muscle, deformed)
    measured = connected(FibreMetrics, carried)
    return {
        "moving": moving,
        "fixed": fixed,
        "deformed": deformed,
        "template": template,
        "fitted": fitted,
        "morphed": morphed,
        "carried": carried,
        "measured": measured,
        "tubes": connected(FibreTubes, measured, radius=RADIUS),
    }


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
