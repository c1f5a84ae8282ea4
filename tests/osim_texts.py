"""Small models of OpenSim, of versions 3 and 4, as text."""

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
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<OpenSimDocument Version="40000"><Model name="leg">
<length_units>meters</length_units>
<Ground name="ground"/>
<BodySet name="bodyset"><objects>
<Body name="femur"><mass>1</mass><mass_center>0 0 0</mass_center><inertia>1 1 1 0 0 0</inertia>
<attached_geometry>
<Mesh name="g"><socket_frame>..</socket_frame><mesh_file>femur.vtp</mesh_file></Mesh>
</attached_geometry>
</Body>
<Body name="tibia"><mass>1</mass><mass_center>0 0 0</mass_center><inertia>1 1 1 0 0 0</inertia></Body>
</objects></BodySet>
<JointSet name="jointset"><objects>
<BallJoint name="hip">
<socket_parent_frame>ground_offset</socket_parent_frame><socket_child_frame>/bodyset/femur</socket_child_frame>
<coordinates><Coordinate name="hip_x"/><Coordinate name="hip_y"/><Coordinate name="hip_z"/></coordinates>
<frames><PhysicalOffsetFrame name="ground_offset"><socket_parent>/ground</socket_parent>
<translation>0 0.9 0</translation><orientation>0.1 0.2 0.3</orientation></PhysicalOffsetFrame></frames>
</BallJoint>
<CustomJoint name="knee">
<socket_parent_frame>femur_offset</socket_parent_frame><socket_child_frame>/bodyset/tibia</socket_child_frame>
<coordinates><Coordinate name="knee_angle"><default_value>0.1</default_value>
<range>-2 2</range></Coordinate></coordinates>
<frames><PhysicalOffsetFrame name="femur_offset"><socket_parent>/bodyset/femur</socket_parent>
<translation>0 -0.4 0</translation><orientation>0 0 0</orientation></PhysicalOffsetFrame></frames>
<SpatialTransform>{"".join(axes)}</SpatialTransform>{joint_extra}
</CustomJoint>
</objects></JointSet>
<ConstraintSet name="constraintset"><objects>{constraints}</objects></ConstraintSet>
<ForceSet name="forceset"><objects>{forces}</objects></ForceSet>
{more}
</Model></OpenSimDocument>"""


LAST = """<PathPoint name="b"><socket_parent_frame>/bodyset/tibia</socket_parent_frame>
<location>0.04 -0.05 0</location></PathPoint>"""
_MUSCLE = """<Thelen2003Muscle name="vastus"><GeometryPath name="geometrypath"><PathPointSet><objects>
<PathPoint name="a"><socket_parent_frame>/bodyset/femur</socket_parent_frame>
<location>0.03 -0.1 0</location></PathPoint>
{point}
{last}
</objects></PathPointSet></GeometryPath>
<max_isometric_force>900</max_isometric_force><optimal_fiber_length>0.08</optimal_fiber_length></Thelen2003Muscle>"""

MOVING = """<MovingPathPoint name="m"><socket_parent_frame>/bodyset/tibia</socket_parent_frame>
<socket_x_coordinate>/jointset/knee/knee_angle</socket_x_coordinate>
<socket_y_coordinate>/jointset/knee/knee_angle</socket_y_coordinate>
<socket_z_coordinate>/jointset/knee/knee_angle</socket_z_coordinate>
<x_location><SimmSpline><x>-2 0 1 2</x><y>0.05 0.06 0.07 0.05</y></SimmSpline></x_location>
<y_location><Constant><value>0.02</value></Constant></y_location>
<z_location><LinearFunction><coefficients>0.001 0.002</coefficients></LinearFunction></z_location>
</MovingPathPoint>"""
CONDITIONAL = """<ConditionalPathPoint name="c"><socket_parent_frame>/bodyset/femur</socket_parent_frame>
<location>0.06 -0.4 0</location><socket_coordinate>/jointset/knee/knee_angle</socket_coordinate>
<range>-3 -0.2</range></ConditionalPathPoint>"""


def model_3(joint="", reverse="false"):
    knee = (
        joint
        or f"""<CustomJoint name="knee"><parent_body>ground</parent_body>
<location_in_parent>0 0.5 0</location_in_parent><orientation_in_parent>0.1 0 0.2</orientation_in_parent>
<location>0 0.1 0</location><orientation>0 0.3 0</orientation>
<CoordinateSet><objects><Coordinate name="knee_angle"><motion_type>rotational</motion_type><range>-2 2</range>
</Coordinate></objects><groups/></CoordinateSet><reverse>{reverse}</reverse>
<SpatialTransform><TransformAxis name="rotation1"><coordinates>knee_angle</coordinates><axis>0 0 1</axis>
<function><LinearFunction><coefficients>1 0</coefficients></LinearFunction></function></TransformAxis>
<TransformAxis name="rotation2"><coordinates/><axis>0 1 0</axis>
<function><Constant/></function></TransformAxis>
<TransformAxis name="rotation3"><coordinates/><axis>1 0 0</axis>
<function><Constant/></function></TransformAxis>
</SpatialTransform></CustomJoint>"""
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<OpenSimDocument Version="30000"><Model name="leg"><credits>Universit\xe9</credits>
<BodySet><objects>
<Body name="ground"><mass>0</mass><Joint/></Body>
<Body name="tibia"><mass>1</mass><Joint>{knee}</Joint>
<VisibleObject><GeometrySet><objects><DisplayGeometry><geometry_file>tibia.vtp</geometry_file>
<transform>0 0 0 0.1 0.2 0.3</transform></DisplayGeometry></objects></GeometrySet></VisibleObject></Body>
</objects></BodySet></Model></OpenSimDocument>"""


def muscle(point, last=LAST):
    return _MUSCLE.format(point=point, last=last)
