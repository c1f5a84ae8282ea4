"""Run by pvpython: the pipeline of scene_on_disk.py by ParaView's proxies. Arguments: folder, result file."""

import json
import sys
from pathlib import Path

import paraview.simple as pv
from paraview import servermanager
from scene_on_disk import TIMES, pipeline, points


def made(name, **values):
    """Return a proxy with inputs and properties, whose names have no underscores here."""
    return getattr(pv, name)(**{key.title().replace("_", ""): value for key, value in values.items()})


def pipeline_of_proxies(folder):
    return pipeline(
        made,
        pv.XMLPolyDataReader(FileName=[str(folder / "muscle.vtp")]),
        pv.XMLMultiBlockDataReader(FileName=[str(folder / "bones.vtm")]),
        pv.XMLMultiBlockDataReader(FileName=[str(folder / "attachments.vtm")]),
        str(folder / "motion.csv"),
    )


def main(folder, file):
    chain = pipeline_of_proxies(folder)
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
