"""Read a file by VTK in a process of its own, for VTK may end the process that reads a damaged file."""

from __future__ import annotations

import json
import signal
import subprocess
import tempfile
from pathlib import Path

from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.vtp_check import check_vtp
from vtkmuscle.isolation import isolated_python

#: The longest that the reading of a file may take [s].
_LONGEST = 300.0

#: What is run: it reads argument 1 by the class of argument 2 and writes what it is as a .vtp to argument 3,
#: or nothing but every time step of it where there is none; and says in JSON what VTK made of it.
_PROGRAM = """
import json
try:
    import resource
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
except ImportError:
    pass
from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
import vtkmodules.vtkIOLegacy, vtkmodules.vtkIOXML, vtkmodules.vtkIOHDF
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
window = vtkStringOutputWindow()
vtkOutputWindow.SetInstance(window)
path, name, out = sys.argv[1:4]
module = {"vtkGenericDataObjectReader": "vtkIOLegacy", "vtkHDFReader": "vtkIOHDF"}.get(name, "vtkIOXML")
reader = getattr(getattr(vtkmodules, module), name)()
reader.SetFileName(path)
if out:
    reader.Update()
else:
    reader.UpdateInformation()
    info, key = reader.GetOutputInformation(0), vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    for time in (info.Get(key) if info.Has(key) else None) or [None]:
        reader.Update() if time is None else reader.UpdateTimeStep(time)
data = reader.GetOutputDataObject(0)
if out and isinstance(data, vtkPolyData):
    writer = vtkmodules.vtkIOXML.vtkXMLPolyDataWriter()
    writer.SetInputData(data)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    writer.SetCompressorTypeToNone()
    writer.SetHeaderTypeToUInt64()
    writer.SetFileName(out)
    said = window.GetOutput()
    writer.Write()
else:
    said = window.GetOutput()
said = said.decode("utf-8", "replace") if isinstance(said, bytes) else said
kind = data.GetClassName() if data is not None else ""
print(json.dumps({"said": said, "error": reader.GetErrorCode(), "kind": kind}))
"""


def read_in_child(path: Path, reader: str) -> tuple[vtkPolyData | None, str, str]:
    """Read poly data by one of VTK's readers in a child process.

    Parameters
    ----------
    path : Path
        The file.
    reader : str
        Name of the reader's class.

    Returns
    -------
    data : vtkPolyData or None
        None where the file holds something else.
    kind : str
        The class of what it holds.
    said : str
        What VTK said, and that it could not read the file.

    Raises
    ------
    ValueError
        If VTK ended the process, or did not end.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "read.vtp"
        found = _run(path, reader, str(out))
        said = found["said"] or ("it is damaged" if found["error"] else "")
        if said or not out.is_file():
            return None, found["kind"], said
        check_vtp(out)
        again = vtkXMLPolyDataReader()
        again.SetFileName(str(out))
        again.Update()
        return again.GetOutput(), found["kind"], ""


def check_in_child(path: Path, reader: str) -> None:
    """Check that one of VTK's readers can read all time steps of a file.

    Parameters
    ----------
    path, reader
        As of :func:`read_in_child`.

    Raises
    ------
    ValueError
        If it cannot.
    """
    found = _run(path, reader, "")
    if found["said"] or found["error"]:
        raise InputError(path, "the file is damaged", "write it again")


def _run(path: Path, reader: str, out: str) -> dict[str, str]:
    command = [*isolated_python(_PROGRAM), str(path.absolute()), reader, out]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_LONGEST, check=False)
    except subprocess.TimeoutExpired:
        raise InputError(path, f"the file was not read within {_LONGEST:.0f} s", "export it again") from None
    if done.returncode:
        name = signal.Signals(-done.returncode).name if done.returncode < 0 else "an error"
        raise InputError(
            path,
            f"the file is damaged: VTK's reader ended with {name}",
            "export it again, and check that its suffix says what it is",
        )
    found: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    return found
