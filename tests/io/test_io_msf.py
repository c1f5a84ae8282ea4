"""Trees of MAF and ALBA: where surfaces and landmarks are, and what is refused."""

import zipfile

import numpy as np
import pytest
import pyvista as pv

from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.data.arrays import points_of
from vtkmuscle.io import landmarks_of, read_msf, surfaces_of

TURNED = rotation_about((1.0, 2.0, 3.0), (1, 2, 0), 40.0)
SHIFTED = np.eye(4)
SHIFTED[:3, 3] = 10.0, -20.0, 5.0


def matrix(pose, time=0.0, tag="Matrix"):
    rows = "\n".join(" ".join(repr(float(x)) for x in row) + " " for row in pose)
    return f'<{tag} TimeStamp="{time:g}">{rows}\n</{tag}>'


def matrices(*poses):
    inner = "".join(matrix(pose, time) for time, pose in poses)
    return f'<MatrixVector NumberOfItems="{len(poses)}">{inner}</MatrixVector>'


def item(url, time=0.0, kind="vtkPolyData", crypting="false"):
    return f"""<VItem Type="mafVMEItemVTK"><URL>{url}</URL><Id>1</Id><DataType>{kind}</DataType>
<TimeStamp>{time:g}</TimeStamp><Crypting>{crypting}</Crypting><Bounds>0 1 0 1 0 1 </Bounds></VItem>"""


def files(*items, attributes='SingleFileMode="false"'):
    return f'<DataVector ItemTypeName="mafVMEItemVTK" {attributes}>{"".join(items)}</DataVector>'


def node(name, kind, *parts, children=(), tags=""):
    return f"""<Node Crypting="0" Id="1" Name="{name}" Type="{kind}">
<Attributes NumberOfItems="1"><Item NumberOfTags="1" Type="mafTagArray"><Name>TagArray</Name>{tags}</Item>
</Attributes><Links NumberOfLinks="0"/>
<Children NumberOfItems="{len(children)}">{"".join(children)}</Children>{"".join(parts)}</Node>"""


def tree(*nodes, version="2.2", head=""):
    return f"""<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>{head}
<MSF Version="{version}"><Root Crypting="0" Id="-1" MaxNodeId="9" Name="hip" Type="mafVMERoot">
<Children NumberOfItems="{len(nodes)}">{"".join(nodes)}</Children><MaxItemId>9</MaxItemId>
{matrix(np.eye(4), tag="Transform")}</Root></MSF>"""


def landmark(name, place, kind="mafVMELandmark"):
    pose = np.eye(4)
    pose[:3, 3] = place
    return node(name, kind, matrices((0.0, pose)))


STATE = '<TItem Mult="1" Name="MFL_VME_LANDMARK_CLOUD_STATE" Type="NUM"><TItem><TC>1</TC></TItem></TItem>'
UNSEEN = np.diag([0.0, 0.0, 0.0, 1.0])
WHOLE = tree(
    node(
        "pelvis",
        "mafVMESurface",
        files(item("hip.1.vtk")),
        matrices((0.0, TURNED), (1.0, SHIFTED)),
        children=[
            node(
                "origin",
                "albaVMELandmarkCloud",
                matrices((0.0, SHIFTED)),
                children=[
                    landmark("ASIS", (1.0, 2.0, 3.0)),
                    landmark("ASIS", (4.0, 5.0, 6.0), "albaVMELandmark"),
                    node("unseen", "mafVMELandmark", matrices((0.0, UNSEEN))),
                ],
            )
        ],
    ),
    node("CT", "mafVMEVolumeGray", files(item("hip.2.vtk", kind="vtkImageData"))),
    node("old", "mafVMELandmarkCloud", files(item("hip.3.vtk")), tags=STATE),
)


@pytest.fixture
def there(tmp_path):
    (tmp_path / "hip.msf").write_text(WHOLE)
    ball = pv.Sphere(radius=30.0, theta_resolution=8, phi_resolution=8)
    ball.save(tmp_path / "hip.1.vtk")
    pv.PolyData(np.array([[1.0, 0, 0], [0, 2, 0]])).save(tmp_path / "hip.3.vtk")
    return tmp_path / "hip.msf", np.asarray(ball.points, dtype=float)


def test_surfaces_are_where_their_matrices_put_them(there):
    path, ball = there
    root = read_msf(path)
    assert [node.name for node, _ in root.walk()][:3] == ["hip", "pelvis", "origin"]
    for time, pose in ((None, TURNED), (0.0, TURNED), (0.9, TURNED), (1.0, SHIFTED), (7.0, SHIFTED)):
        found = surfaces_of(root, time)
        assert list(found) == ["pelvis"]
        np.testing.assert_allclose(points_of(found["pelvis"]), apply_transform(pose, ball), atol=1e-9)


def test_landmarks_are_in_the_frames_of_cloud_and_parent(there):
    found = landmarks_of(read_msf(there[0]))
    assert list(found["origin"]) == ["ASIS", "ASIS (2)"]
    expected = apply_transform(TURNED @ SHIFTED, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    np.testing.assert_allclose(list(found["origin"].values()), expected, atol=1e-9)
    np.testing.assert_allclose(list(found["old"].values()), [[1.0, 0, 0], [0, 2, 0]])


def test_a_file_in_an_archive_of_its_own_is_read(there):
    path, ball = there
    with zipfile.ZipFile(path.with_name("hip.1.zvtk"), "w") as archive:
        archive.write(path.with_name("hip.1.vtk"), "hip.1.vtk")
    path.write_text(WHOLE.replace("hip.1.vtk", "hip.1.zvtk"))
    found = surfaces_of(read_msf(path))["pelvis"]
    np.testing.assert_allclose(points_of(found), apply_transform(TURNED, ball), atol=1e-9)
    path.with_name("hip.1.zvtk").write_bytes(b"PK\x03\x04 and no more")
    with pytest.raises(ValueError, match="the archive cannot be read"):
        surfaces_of(read_msf(path))


@pytest.mark.parametrize(
    "name", ["../hip.1.vtk", "/etc/passwd", "a/../../b.vtk", "..\\b.vtk", "C:\\b.vtk", "\\\\host\\b.vtk", ""]
)
def test_files_out_of_the_folder_are_refused(tmp_path, name):
    path = tmp_path / "a.msf"
    path.write_text(tree(node("pelvis", "mafVMESurface", files(item(name)))))
    with pytest.raises(ValueError, match="outside the folder"):
        read_msf(path)


def test_a_link_out_of_the_folder_is_refused(tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "away.vtk").symlink_to(tmp_path / "secret.vtk")
    path = tmp_path / "in" / "a.msf"
    path.write_text(tree(node("pelvis", "mafVMESurface", files(item("away.vtk")))))
    with pytest.raises(ValueError, match="outside the folder"):
        read_msf(path)


REFUSED = {
    "entities": (
        tree(head='<!DOCTYPE a [<!ENTITY secret SYSTEM "file:///etc/passwd">]>'),
        "line 1: the file has a document type",
    ),
    "version 1": (tree(version="1.0"), "not a tree .MSF. of version 2"),
    "another format": ("<OpenSimDocument Version='40000'/>", "not a tree"),
    "enciphered": (tree(node("a", "mafVMESurface", files(item("a.vtk", crypting="true")))), "encrypted"),
    "one archive": (
        tree(node("a", "mafVMESurface", files(attributes='SingleFileMode="true"'))),
        "in an archive",
    ),
    "flat": (tree(node("a", "mafVMESurface", matrices((0.0, UNSEEN)))), "is no pose"),
    "projective": (tree(node("a", "mafVMEGroup", matrices((0.0, np.ones((4, 4)))))), "is no pose"),
    "short": (WHOLE.replace('<Matrix TimeStamp="1">', '<Matrix TimeStamp="1">7 '), "16 finite numbers"),
    "no time": (WHOLE.replace('TimeStamp="1"', 'TimeStamp="soon"'), "TimeStamp is 'soon'"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_tree_is_refused_with_its_place(tmp_path, name):
    path = tmp_path / "a.msf"
    path.write_text(REFUSED[name][0])
    with pytest.raises(ValueError, match=REFUSED[name][1]) as caught:
        read_msf(path)
    assert "a.msf" in str(caught.value)
