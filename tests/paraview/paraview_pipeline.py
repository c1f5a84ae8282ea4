"""Run by pvpython: the pipeline of scene_on_disk.py by ParaView's proxies. Arguments: folder, result file."""

import json
import sys
from pathlib import Path

import paraview.simple as pv
from paraview import servermanager
from scene_on_disk import N_FIBRES, RADIUS, TIMES, points


def pipeline(folder):
    muscle = pv.XMLPolyDataReader(FileName=[str(folder / "muscle.vtp")])
    bones = pv.XMLMultiBlockDataReader(FileName=[str(folder / "bones.vtm")])
    attachments = pv.XMLMultiBlockDataReader(FileName=[str(folder / "attachments.vtm")])
    moving = pv.BoneMotion(Bones=bones, Motion=str(folder / "scene/scene.toml"))
    fixed = pv.FixedPointDetector(Muscle=muscle, Bones=bones, Attachments=attachments)
    deformed = pv.PBDDeformer(Muscle=fixed, Bones=moving)
    template = pv.FibreTemplateSource(NFibres=N_FIBRES)
    fitted = pv.TemplateFitter(Template=template, Muscle=muscle, Attachments=attachments)
    morphed = pv.SliceMorpher(Template=fitted, Muscle=muscle)
    trimmed = pv.FibreTrimmer(Fibres=morphed, Muscle=muscle, Attachments=attachments)
    smoothed = pv.FibreSmoother(Fibres=trimmed)
    carried = pv.FibreTransport(RestFibres=smoothed, RestMuscle=muscle, DeformedMuscle=deformed)
    measured = pv.FibreMetrics(Fibres=carried)
    return {
        "moving": moving,
        "fixed": fixed,
        "deformed": deformed,
        "template": template,
        "fitted": fitted,
        "morphed": morphed,
        "carried": carried,
        "measured": measured,
        "tubes": pv.FibreTubes(Fibres=measured, Radius=RADIUS),
    }


def main(folder, file):
    chain = pipeline(folder)
    found = {}
    for time in TIMES:
        for name, proxy in chain.items():
            proxy.UpdatePipeline(time)
            found[f"{name} at {time:g}"] = points(servermanager.Fetch(proxy))
    chain["deformed"].UpdatePipelineInformation()
    found["time steps"] = list(chain["deformed"].TimestepValues)
    file.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
