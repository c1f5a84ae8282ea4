"""Small models of OpenSim, of versions 3 and 4, as text."""

from pathlib import Path


def text(name, **values):
    """Return a text of the folder of models, with its values."""
    return (Path(__file__).parent / "osim/models" / name).read_text("utf-8").format(**values)


_AXIS = """<TransformAxis name="{name}"><coordinates>{coordinate}</coordinates><axis>{axis}</axis>
<{function} name="function">{content}</{function}></TransformAxis>"""


def axis(name, direction, coordinate="", function="Constant", content="<value>0</value>"):
    return _AXIS.format(name=name, axis=direction, coordinate=coordinate, function=function, content=content)


SPLINE = "<x>-2 -1 0 1 2</x><y>0.01 0.02 -0.01 0.03 0</y>"
LINE = "<coefficients>1 0</coefficients>"


def model_4(*, joint_extra="", constraints="", forces="", more="", axes=None):
    axes = axes or [
        axis("rotation1", "0 0 1", "knee_angle", "LinearFunction", LINE),
        axis("rotation2", "0 1 0"),
        axis("rotation3", "1 0 0", "knee_angle", "MultiplierFunction",
             "<function><PolynomialFunction><coefficients>0.1 0.2 0</coefficients></PolynomialFunction>"
             "</function><scale>0.5</scale>"),
        axis("translation1", "1 0 0", "knee_angle", "SimmSpline", SPLINE),
        axis("translation2", "0 1 0"),
        axis("translation3", "0 0 1", "knee_angle", "PiecewiseLinearFunction", SPLINE),
    ]  # fmt: skip
    fields = {"axes": "".join(axes), "joint_extra": joint_extra, "constraints": constraints}
    return text("leg_4.osim", forces=forces, more=more, **fields)


LAST = """<PathPoint name="b"><socket_parent_frame>/bodyset/tibia</socket_parent_frame>
<location>0.04 -0.05 0</location></PathPoint>"""
MOVING, CONDITIONAL = text("moving_point.xml"), text("conditional_point.xml")


def model_3(joint="", reverse="false"):
    return text("leg_3.osim", knee=joint or text("knee_3.xml", reverse=reverse))


def muscle(point, last=LAST):
    return text("vastus.xml", point=point, last=last)
