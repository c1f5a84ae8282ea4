"""Trees of MAF and ALBA: where landmarks are, and what is refused."""

import numpy as np
import pytest

from vtkmuscle.core.motion.rigid import apply_transform, rotation_about
from vtkmuscle.io import read_msf

TURNED = rotation_about((1.0, 2.0, 3.0), (1, 2, 0), 40.0)
SHIFTED = np.eye(4)
SHIFTED[:3, 3] = 10.0, -20.0, 5.0


def matrix(pose, time=0.0, tag="Matrix"):
    rows = "\n".join(" ".join(repr(float(x)) for x in row) + " " for row in pose)
    return f'<{tag} TimeStamp="{time:g}">{rows}\n</{tag}>'


def matrices(*poses):
    inner = "".join(matrix(pose, time) for time, pose in poses)
    return f'<MatrixVector NumberOfItems="{len(poses)}">{inner}</MatrixVector>'


def node(name, kind, *parts, children=()):
    return f"""<Node Crypting="0" Id="1" Name="{name}" Type="{kind}">
<Attributes NumberOfItems="1"><Item NumberOfTags="0" Type="mafTagArray"><Name>TagArray</Name></Item>
</Attributes><Links NumberOfLinks="0"/>
<Children NumberOfItems="{len(children)}">{"".join(children)}</Children>{"".join(parts)}</Node>"""


def tree(*nodes, version="2.2"):
    return f"""<?xml version="1.0" encoding="UTF-8" standalone="yes" ?>
<MSF Version="{version}"><Root Crypting="0" Id="-1" MaxNodeId="9" Name="hip" Type="mafVMERoot">
<Children NumberOfItems="{len(nodes)}">{"".join(nodes)}</Children><MaxItemId>9</MaxItemId>
{matrix(np.eye(4), tag="Transform")}</Root></MSF>"""


def landmark(name, place, kind="mafVMELandmark"):
    pose = np.eye(4)
    pose[:3, 3] = place
    return node(name, kind, matrices((0.0, pose)))


UNSEEN = np.diag([0.0, 0.0, 0.0, 1.0])
WHOLE = tree(
    node(
        "pelvis",
        "mafVMESurface",
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
    node("CT", "mafVMEVolumeGray"),
)


@pytest.fixture
def there(tmp_path):
    (tmp_path / "hip.msf").write_text(WHOLE)
    return tmp_path / "hip.msf"


def test_landmarks_are_in_the_frames_of_cloud_and_parent(there):
    found = read_msf(there)
    assert list(found["origin"]) == ["ASIS", "ASIS (2)"]
    expected = apply_transform(TURNED @ SHIFTED, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    np.testing.assert_allclose(list(found["origin"].values()), expected, atol=1e-9)


REFUSED = {
    "version 1": (tree(version="1.0"), "not a tree .MSF. of version 2"),
    "another format": ("<OpenSimDocument Version='40000'/>", "not a tree"),
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
