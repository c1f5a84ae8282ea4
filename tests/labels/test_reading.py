"""Label maps as files: what was written is read, in its place, with its names."""

import gzip
import os
import struct
import sys

import numpy as np
import pytest

from vtkmuscle.core.errors import InputError
from vtkmuscle.data.label_images import labels_in
from vtkmuscle.labels.reading import read_labels

VOXELS = np.zeros((4, 5, 6), dtype=np.uint8)
VOXELS[1:3, 1:4, 2:5], VOXELS[3, 4, 5] = 1, 2
#: Askew, and left-handed: j and k are exchanged.
FRAME = np.array([[0.8, 0, 0.6, 10], [0.6, 0, -0.8, -20], [0, 1, 0, 30], [0, 0, 0, 1.0]]) @ np.diag(
    [1, 2, 3, 1]
)


@pytest.fixture
def write():
    sitk = pytest.importorskip("SimpleITK")

    def written(path, voxels=VOXELS, **words):
        image = sitk.GetImageFromArray(voxels, isVector=voxels.ndim == 4)
        size = np.linalg.norm(FRAME[:3, :3], axis=0)
        image.SetSpacing(size.tolist())
        image.SetOrigin(FRAME[:3, 3].tolist())
        image.SetDirection((FRAME[:3, :3] / size).ravel().tolist())
        for key, value in words.items():
            image.SetMetaData(key, value)
        sitk.WriteImage(image, str(path))
        return path

    return written


@pytest.mark.parametrize("suffix", [".nii.gz", ".nii", ".nrrd", ".mha"])
def test_a_map_is_read_where_it_is(write, tmp_path, suffix):
    (image,) = read_labels(write(tmp_path / f"map{suffix}"))
    found = labels_in(image, "")
    assert list(found) == ["label_1", "label_2"]
    assert np.array_equal(found["label_1"].voxels, VOXELS)
    assert found["label_1"].frame == pytest.approx(FRAME, abs=1e-5)
    (turned,) = read_labels(tmp_path / f"map{suffix}", frame="RAS")
    assert labels_in(turned, "")["label_1"].frame == pytest.approx(np.diag([-1, -1, 1, 1]) @ FRAME, abs=1e-5)


def test_names_are_those_of_totalsegmentator_in_the_header(write, tmp_path):
    content = bytearray(write(tmp_path / "map.nii").read_bytes())
    words = b'<LabelTable><Label Key="1" Red="0"><![CDATA[femur_left]]></Label><Label Key="2">sacrum</Label>'
    words += b" " * (-(8 + len(words)) % 16)
    content[108:112] = struct.pack("<f", 352 + 8 + len(words))
    content[348] = 1
    content[352:352] = struct.pack("<ii", 8 + len(words), 30) + words
    (tmp_path / "named.nii.gz").write_bytes(gzip.compress(bytes(content)))
    (image,) = read_labels(tmp_path / "named.nii.gz")
    assert list(labels_in(image, "")) == ["femur_left", "sacrum"]


def test_a_segmentation_of_slicer_has_names_and_layers(write, tmp_path):
    layers = np.stack([VOXELS, VOXELS[::-1]], axis=-1)
    words = {"Segment0_LabelValue": "1", "Segment0_Name": "femur, left ", "Segment0_Layer": "0"}
    words |= {"Segment1_LabelValue": "1", "Segment1_Name": "iliacus", "Segment1_Layer": "1"}
    images = read_labels(write(tmp_path / "map.seg.nrrd", layers, **words))
    assert [next(iter(labels_in(image, ""))) for image in images] == ["femur left", "iliacus"]


def test_a_folder_has_a_file_for_each_structure(write, tmp_path):
    for name in ("femur_left", "iliacus_left"):
        write(tmp_path / f"{name}.nii.gz", (VOXELS > 0).astype(np.uint8))
    images = read_labels(tmp_path)
    assert [list(labels_in(image, "")) for image in images] == [["femur_left"], ["iliacus_left"]]
    write(tmp_path / "all.nii.gz", VOXELS)  # was one structure
    with pytest.raises(InputError, match="a file in a folder has several labels; give the file alone"):
        read_labels(tmp_path)


def test_a_dicom_segmentation_is_read_where_it_is(tmp_path):
    highdicom, pydicom = pytest.importorskip("highdicom"), pytest.importorskip("pydicom")
    code = pydicom.sr.codedict.codes.SCT
    scheme = {"segmented_property_category": code.Organ, "segmented_property_type": code.Bone}
    scheme["algorithm_type"] = "MANUAL"
    uid, axes = highdicom.UID, FRAME[:, [2, 1, 0, 3]]
    volume = highdicom.Volume(VOXELS, axes, "PATIENT", frame_of_reference_uid=uid())
    source = pydicom.dataset.Dataset()
    empty = ("PatientBirthDate", "PatientSex", "StudyDate", "StudyTime", "AccessionNumber")
    words = dict.fromkeys([*empty, "ReferringPhysicianName"], "")
    words |= {"PatientID": "1", "PatientName": "A^B", "StudyID": "1", "Modality": "CT"}
    words |= {"SOPClassUID": pydicom.uid.CTImageStorage, "FrameOfReferenceUID": volume.frame_of_reference_uid}
    words |= {"Rows": 5, "Columns": 6, "ImagePositionPatient": [0, 0, 0], "PixelSpacing": [1, 1]}
    words |= {"ImageOrientationPatient": [1, 0, 0, 0, 1, 0], "SliceThickness": 1}
    for key in ("StudyInstanceUID", "SeriesInstanceUID", "SOPInstanceUID"):
        words[key] = uid()
    for key, value in words.items():
        setattr(source, key, value)
    segment = highdicom.seg.SegmentDescription
    segments = [segment(n, name, **scheme) for n, name in ((1, "femur"), (2, "sacrum"))]
    series = (uid(), 2, uid(), 1, "us", "phantom", "1", "1")
    segmentation = highdicom.seg.Segmentation([source], volume, "BINARY", segments, *series)
    segmentation.save_as(tmp_path / "map.dcm")
    (image,) = read_labels(tmp_path / "map.dcm")
    found = labels_in(image, "")
    assert list(found) == ["femur", "sacrum"]
    label = found["femur"]
    index = np.argwhere(label.voxels == 1)[:, ::-1]
    true = np.argwhere(VOXELS == 1)[:, ::-1]
    places, expected = (
        sorted(map(tuple, (ijk @ frame[:3, :3].T + frame[:3, 3]).round(3).tolist()))
        for ijk, frame in ((index, label.frame), (true, FRAME))
    )
    assert np.allclose(places, expected)


@pytest.mark.parametrize(("names", "first"), [("total", "spleen"), ("musclemap", "label_1")])
def test_names_are_those_of_a_table(write, tmp_path, names, first):
    (image,) = read_labels(write(tmp_path / "map.nrrd"), names=names)
    assert next(iter(labels_in(image, ""))) == first


def test_names_are_those_of_a_csv_file(write, tmp_path):
    (tmp_path / "names.csv").write_text("label,name\n2,femur\n1,iliacus\n")
    (image,) = read_labels(write(tmp_path / "map.nrrd"), names=str(tmp_path / "names.csv"))
    assert list(labels_in(image, "")) == ["iliacus", "femur"]


def test_what_is_no_label_map_is_refused(write, tmp_path):
    with pytest.raises(ValueError, match="not whole numbers"):
        read_labels(write(tmp_path / "map.nrrd", VOXELS + np.float32(0.5)))
    with pytest.raises(ValueError, match="did you mean 'total'"):
        read_labels(tmp_path / "map.nrrd", names="totall")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="there is no label map"):
        read_labels(tmp_path / "empty")
    (tmp_path / "broken.nrrd").write_text("NRRD")
    with pytest.raises(ValueError, match="cannot be read as an image"):
        read_labels(tmp_path / "broken.nrrd")
    with pytest.raises(FileNotFoundError):
        read_labels(tmp_path / "absent.nrrd")


HEADER = "ObjectType = Image\nNDims = 3\nDimSize = 9 9 9\nElementType = MET_UCHAR\nElementDataFile = {}\n"


@pytest.mark.parametrize("packed", [True, False])
def test_a_header_that_promises_more_than_the_file_has_is_refused_before_a_voxel_is_read(
    write, tmp_path, packed
):
    content = bytearray(write(tmp_path / "map.nii").read_bytes())
    content[42:48] = struct.pack("<hhh", *([2000] * 3 if packed else [10] * 3))
    path = tmp_path / ("big.nii.gz" if packed else "big.nii")
    path.write_bytes(gzip.compress(bytes(content)) if packed else bytes(content))
    with pytest.raises(ValueError, match=r"big\.nii.*promises .* bytes of voxels, but the file has"):
        read_labels(path)


def test_a_header_names_plain_files_only(tmp_path):
    pytest.importorskip("SimpleITK")
    for number, data in enumerate(("pipe", "LIST\npipe", "pi%d.raw 1 1 1", "/dev/zero")):
        if number < 3:
            os.mkfifo(tmp_path / ("pipe" if number < 2 else "pi1.raw")) if number != 1 else None
        (tmp_path / "map.mhd").write_text(HEADER.format(data))
        with pytest.raises(FileNotFoundError, match="pipe or a device, not a file"):
            read_labels(tmp_path / "map.mhd")
    (tmp_path / "map.raw").write_bytes(bytes(728) + b"\1")
    (tmp_path / "map.mhd").write_text(HEADER.format("map.raw"))
    assert list(labels_in(read_labels(tmp_path / "map.mhd")[0], "")) == ["label_1"]


def test_labels_are_whole_numbers_named_with_file_and_key(write, tmp_path):
    path = write(tmp_path / "map.nrrd", Segment0_LabelValue="x", Segment0_Name="femur")
    with pytest.raises(ValueError, match=r"map\.nrrd: Segment0_LabelValue is 'x', but must be a whole"):
        read_labels(path)
    (tmp_path / "names.csv").write_text(f"1,iliacus\n{'9' * 23},femur\n")
    with pytest.raises(ValueError, match=r"names\.csv: line 2: the label is '9{23}'"):
        read_labels(write(tmp_path / "good.nrrd"), names=str(tmp_path / "names.csv"))


def test_what_a_foreign_reader_raises_is_an_error_with_the_file(tmp_path):
    pytest.importorskip("highdicom")
    (tmp_path / "junk.dcm").write_text("junk")
    with pytest.raises(ValueError, match=r"junk\.dcm: not a DICOM Segmentation: "):
        read_labels(tmp_path / "junk.dcm")


@pytest.mark.parametrize(("file", "package"), [("map.nrrd", "SimpleITK"), ("map.dcm", "highdicom")])
def test_without_the_extra_it_says_what_to_install(tmp_path, monkeypatch, file, package):
    (tmp_path / file).touch()
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ValueError, match=rf"needs {package}.*python -m pip install {package}"):
        read_labels(tmp_path / file)
