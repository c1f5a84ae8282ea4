"""Segmentation files: NIfTI, NRRD, MetaImage and DICOM; label names, and kinds of structures by name."""

import gzip
import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkImageData

from vtkmuscle.core.errors import MOST_TEXT, InputError, MissingFileError, check_is_file
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.data import package_text
from vtkmuscle.data.anatomy import ANATOMY, has_word, plain_name
from vtkmuscle.data.label_images import MOST, label_image
from vtkmuscle.io.csv_table import csv_rows
from vtkmuscle.io.landmarks import FRAMES
from vtkmuscle.run.table import optional_package

#: Endings of supported files.
SUFFIXES = (".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd", ".dcm")
#: Size of a NIfTI header [bytes]; extensions follow 4 bytes later.
_NIFTI_HEADER = 348
#: Greatest ratio of deflate's compression.
_DEFLATED = 1032
#: Names of data files in text headers, and the mark of compression.
_DATA_FILE = re.compile(rb"^(?:ElementDataFile\s*=|data ?file:)[ \t]*([^\r\n]*)([^\0]*)", re.I | re.M)
_COMPRESSED = re.compile(rb"^(?:CompressedData\s*=\s*True|encoding:\s*(?:gz|bz))", re.I | re.M)
_NIFTI_LABEL = re.compile(rb'<Label\s[^>]*?Key="(\d+)"[^>]*>\s*(?:<!\[CDATA\[)?([^<\]]+)')


def read_labels(
    path: str | PathLike[str], *, names: str | None = None, frame: str = "LPS"
) -> list[vtkImageData]:
    """Read a segmentation as images for LabelSurfaces [mm]; several images for overlapping labels.

    ``path`` is a .nii, .nii.gz, .nrrd, .nhdr, .mha or .mhd file of labels; a .seg.nrrd file of 3D Slicer; a
    DICOM Segmentation (.dcm); or a folder of such files, each for the structure in the file's name. ``names``
    is ``"musclemap"``, a task of TotalSegmentator such as ``"total"``, or a .csv file with lines of label,
    name; by default the names in the file. ``frame``, ``"LPS"`` or ``"RAS"``, is of the images' world.
    FileNotFoundError or ValueError for an unreadable file or no labels; without SimpleITK, or for DICOM
    without highdicom.
    """
    source = Path(path)
    if frame not in FRAMES:
        raise InputError("frame", f"there is no frame {frame!r}", f"allowed: {', '.join(FRAMES)}")
    if not source.exists():
        raise MissingFileError(source, "there is no such file or folder")
    files = sorted(source.iterdir()) if source.is_dir() else [source]
    files = [file for file in files if file.name.lower().endswith(SUFFIXES)]
    if not files:
        raise InputError(source, "there is no label map", f"files end in {', '.join(SUFFIXES)}")
    table = None if names is None else name_table(names)
    to_frame = np.diag([-1.0, -1.0, 1.0, 1.0]) if frame == "RAS" else np.eye(4)
    images = []
    for file in files:
        for voxels, transform, own in _read(file):
            by_label = own if table is None else table
            if source.is_dir() and file.suffix.lower() != ".dcm":
                if ((voxels > 0) & (voxels < voxels.max())).any():
                    raise InputError(file, "a file in a folder has several labels", "give the file alone")
                by_label = {1: re.sub(r"(\.seg)?\.(nii\.gz|\w+)$", "", file.name)}
                np.clip(voxels, 0, 1, out=voxels)
            images.append(label_image(voxels, to_frame @ transform, by_label))
    return images


Layer = tuple[NDArray[np.integer], Floats, Mapping[int, str]]


def _read(file: Path) -> Iterator[Layer]:
    """Yield voxels (nk, nj, ni), world transform and names by layer."""
    if file.suffix.lower() == ".dcm":
        yield _dicom(file)
        return
    itk = optional_package("SimpleITK", "a label map", file=file)
    reader = itk.ImageFileReader()
    reader.SetFileName(str(file))
    with _foreign(file, "it cannot be read as an image"):
        reader.ReadImageInformation()
    bits = re.search(r"(\d+)-bit", itk.GetPixelIDValueAsString(reader.GetPixelID()))
    voxel = reader.GetNumberOfComponents() * (int(bits[1]) // 8 if bits else 1)
    _check_size(file, voxel * math.prod(reader.GetSize()))
    with _foreign(file, "it cannot be read as an image"):
        image = reader.Execute()
    if (n := image.GetDimension()) != 3:
        raise InputError(file, f"the image has {n} dimensions, but must have 3", "save one volume of labels")
    transform = np.eye(4)
    transform[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * image.GetSpacing()
    transform[:3, 3] = image.GetOrigin()
    voxels = itk.GetArrayFromImage(image)
    if not np.issubdtype(voxels.dtype, np.integer):
        with np.errstate(invalid="ignore"):
            whole = voxels.astype(np.int32)
        if not np.array_equal(whole, voxels):
            raise InputError(file, "the values are not whole numbers", "give a map of labels, not an image")
        voxels = whole
    layers = voxels[..., None] if voxels.ndim == 3 else voxels
    names = _names(file, image)
    for number in range(layers.shape[-1]):
        yield np.ascontiguousarray(layers[..., number]), transform, names.get(number, {})


def _check_size(file: Path, promised: int) -> None:
    """Raise an error if the voxels [bytes] do not fit into the file, or into the files in the header."""
    with file.open("rb") as stream:
        head = stream.read(MOST_TEXT)
    text = file.suffix.lower() in (".mhd", ".nhdr", ".mha", ".nrrd")
    match = _DATA_FILE.search(head) if text else None
    files = [file]
    if match and match[1].strip().upper() != b"LOCAL":
        first = match[1].decode("utf-8", "replace").strip()
        names = [first.split(" ")[0] if "%" in first else first]
        if first.upper().startswith("LIST"):
            names = match[2].decode("utf-8", "replace").split()
        for name in names:
            pattern = re.sub(r"%\d*d", "*", name)
            files += sorted(file.parent.glob(pattern)) if pattern != name else [file.parent / name]
    for each in files:
        check_is_file(each)
    packed = file.suffix.lower() == ".gz" or (text and _COMPRESSED.search(head))
    size = sum(each.stat().st_size for each in files)
    if promised > (_DEFLATED if packed else 1) * size:
        problem = f"the header promises {promised:.3g} bytes of voxels, but the file has {size}"
        raise InputError(file, problem, "the file is damaged or incomplete, copy it again")


@contextmanager
def _foreign(file: Path, problem: str) -> Iterator[None]:
    """Turn any exception of a foreign reader into an InputError."""
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:
        why = (str(error).strip().splitlines() or [type(error).__name__])[-1]
        raise InputError(file, f"{problem}: {why}", "export it again") from error


def _names(file: Path, image: Any) -> dict[int, dict[int, str]]:
    """Return the label names in a file's header, by layer."""
    names: dict[int, dict[int, str]] = {}
    if file.name.lower().endswith((".nii", ".nii.gz")):
        opened = gzip.open if file.suffix.lower() == ".gz" else open
        with _foreign(file, "its header cannot be read"), opened(file, "rb") as stream:
            offset = int(float(image.GetMetaData("vox_offset")))
            header = stream.read(min(max(_NIFTI_HEADER, offset), MOST_TEXT))
        labels = _NIFTI_LABEL.findall(header[_NIFTI_HEADER:])
        numbers = [label_number(key.decode(), file, "Label Key") for key, _ in labels]
        texts = [name.decode("utf-8", "replace").strip() for _, name in labels]
        names[0] = dict(zip(numbers, texts, strict=True))
    for key in image.GetMetaDataKeys():
        segment = re.fullmatch(r"(Segment\d+)_LabelValue", key)
        if segment and image.HasMetaDataKey(f"{segment[1]}_Name"):
            at = f"{segment[1]}_Layer"
            layer = label_number(image.GetMetaData(at), file, at) if image.HasMetaDataKey(at) else 0
            value = label_number(image.GetMetaData(key), file, key)
            names.setdefault(layer, {})[value] = image.GetMetaData(f"{segment[1]}_Name")
    return names


def _dicom(file: Path) -> Layer:
    """Return the segments of a DICOM Segmentation; later segments overwrite earlier."""
    highdicom = optional_package("highdicom", "a DICOM Segmentation", file=file)
    check_is_file(file)
    with _foreign(file, "not a DICOM Segmentation"):
        segmentation = highdicom.seg.segread(file)
        volume = segmentation.get_volume(combine_segments=True, skip_overlap_checks=True)
        numbers = segmentation.segment_numbers
        names = {n: str(segmentation.get_segment_description(n).segment_label) for n in numbers}
    # highdicom's axes are planes, rows and columns, from voxel numbers in that order to LPS.
    transform = np.array(volume.affine, dtype=np.float64)[:, [2, 1, 0, 3]]
    return np.ascontiguousarray(volume.array), transform, names


_MUSCLES = re.compile(rf"(?:^|_)(?:{'|'.join(ANATOMY['muscle_starts'])})")


def kind_of(name: str) -> str | None:
    """Return ``"bone"``, ``"muscle"``, or None for other names."""
    if has_word(name, ANATOMY["other_words"]):
        return None
    if _MUSCLES.search(plain_name(name)):
        return "muscle"
    return "bone" if has_word(name, ANATOMY["bone_words"]) else None


@cache
def _tables() -> dict[str, dict[int, str]]:
    tables: dict[str, dict[int, str]] = {}
    for line in package_text("vtkmuscle.labels", "names.csv").splitlines()[3:]:
        table, label, name = line.split(",")
        tables.setdefault(table, {})[int(label)] = name
    return tables


def label_number(text: str, path: Path, where: str) -> int:
    """Return the whole number in a text, from 0 to the largest label."""
    if not re.fullmatch(r"\s*[0-9]{1,9}\s*", text, re.ASCII) or int(text) > MOST:
        problem = f"{where} is {quoted(text.strip())}, but must be a whole number from 0 to {MOST}"
        raise InputError(path, problem, "correct it")
    return int(text)


def name_table(source: str) -> dict[int, str]:
    """Return names by label from a built-in or .csv table with lines of label, name."""
    if source in _tables():
        return _tables()[source]
    path = Path(source)
    if path.suffix.lower() != ".csv":
        raise InputError(source, "unknown table of names", suggestion(source, [*_tables(), "FILE.csv"]))
    names: dict[int, str] = {}
    for number, cells in csv_rows(path):
        if len(cells) > 1 and (cells[0].isdecimal() or names):
            names[label_number(cells[0], path, f"line {number}: the label")] = cells[1]
        elif names:
            raise InputError(path, f"line {number} is not a label and a name", "write 5, femur_left")
    if not names:
        raise InputError(path, "the file has no line of a label and a name", "write 5, femur_left")
    return names
