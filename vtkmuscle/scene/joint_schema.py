"""The tables of a scene's joints, of a model of OpenSim in their place, and of Hill's parameters."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, model_validator

from vtkmuscle.core.words import quoted
from vtkmuscle.scene.schema_types import (
    FiniteNumbers,
    OneOf,
    Table,
    Text,
    Triple,
    direction,
    fault,
    is_finite,
)

#: Kinds of joints, and how many turns each has; a custom one says so itself.
JOINT_KINDS = {"pin": 1, "ball": 3, "weld": 0, "custom": None}
_ENDS = "a least and a largest value"


def _number(value: Any) -> float:
    if not is_finite(value):
        raise fault(f"must be a finite number, not {quoted(value)}", "")
    return float(value)


def _ascending(ends: list[float]) -> list[float]:
    if ends[0] >= ends[1]:
        raise fault(f"must be {_ENDS}, not {quoted(ends)}", "")
    return ends


def _named(value: Any) -> Any:
    if isinstance(value, list) and all(isinstance(name, str) and name for name in value):
        return {name: {} for name in value}
    if not isinstance(value, dict):
        remedy = 'write ["NAME"], or { NAME = { range = [0, 120], positive = "flexion" } }'
        raise fault(f"must be a list of names, not {quoted(value)}", remedy)
    return value


def _three_axes(value: Any) -> Any:
    if not isinstance(value, list) or len(value) != 3:
        remedy = "write axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
        raise fault(f"must be three directions, not {quoted(value)}", remedy)
    return value


Number = Annotated[float, PlainValidator(_number)]
Numbers = Annotated[list[float], FiniteNumbers()]
Range = Annotated[list[float], FiniteNumbers(2, _ENDS), AfterValidator(_ascending)]
Direction = Annotated[Triple, AfterValidator(direction)]


class Knots(Table):
    """Knots of a function."""

    x: Numbers = Field(examples=[[0.0, 60.0, 120.0]], description="Of the coordinate, ascending.")
    y: Numbers = Field(examples=[[0.0, 2.0, 5.0]], description="Of the function, as many.")


class Function(Table):
    """A function of a coordinate: one of its keys."""

    polynomial: Numbers | None = Field(
        None,
        examples=[[0.5, 0.0]],
        description="Coefficients of a polynomial, highest power first: [0.5, 0] is half the coordinate.",
    )
    spline: Knots | None = Field(
        None,
        description="A cubic spline through knots { x = [...], y = [...] }, straight beyond them: OpenSim's "
        "SimmSpline.",
    )
    piecewise: Knots | None = Field(None, description="Straight lines through knots.")


class JointCoordinateTable(Function):
    """A coordinate of a joint. With a function it follows another coordinate."""

    range: Range | None = Field(
        None,
        examples=[[0.0, 120.0]],
        description="Least and largest value: a motion beyond them gives a warning.",
    )
    rest: Number = Field(0.0, examples=[0.0], description="Its value in the rest pose.")
    positive: Text | None = Field(
        None, examples=["flexion"], description="What its positive direction is, in words."
    )
    follows: Text | None = Field(
        None,
        examples=["knee_angle"],
        description="Another coordinate, which this one is a function of, as a patella's is of the knee's: "
        "then one of polynomial, spline and piecewise says which.",
    )


class Axis(Function):
    """A turn or a slide of a custom joint."""

    axis: Direction = Field(
        examples=[[1.0, 0.0, 0.0]], description="Direction, of any length; turns are right-handed about it."
    )
    coordinate: Text | None = Field(
        None, examples=["knee_angle"], description="The coordinate that it depends on."
    )
    constant: Number | None = Field(
        None, examples=[0.0], description="How far, where it depends on no coordinate."
    )


class JointTable(Table):
    """How a bone moves against another one."""

    parent: Text = Field(examples=["femur"], description="The bone that the joint hangs on.")
    child: Text = Field(
        examples=["tibia"],
        description="The bone that it moves. Each bone is the child of one joint at most; those of none "
        "stay where they are. Between two joints there may be a body that is no bone of the scene.",
    )
    type: Annotated[str, OneOf(JOINT_KINDS, "kind of joint")] = Field(
        examples=["pin"],
        description="pin turns about one axis, ball about three, each going along with those before it, "
        "weld not at all; custom has rotations and translations.",
    )
    centre: Triple | None = Field(
        None,
        examples=[[0.0, 0.0, 0.0]],
        description="A point on the axes, in the rest pose, from which a joint's slides are counted. Needed "
        "but for a weld.",
    )
    axis: Direction | None = Field(
        None, examples=[[1.0, 0.0, 0.0]], description="Of a pin: positive angles turn right-handed about it."
    )
    axes: Annotated[list[Direction], BeforeValidator(_three_axes)] | None = Field(
        None,
        examples=[[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]],
        description="Of a ball, where its coordinates are 0: the second goes along with the first, the third "
        "with both. Without it x, y and z.",
    )
    coordinates: Annotated[dict[str, JointCoordinateTable], BeforeValidator(_named)] | None = Field(
        None,
        examples=[["knee_angle"]],
        description="Names of its coordinates, one for each turn of a pin or a ball; or a table of them. "
        "Angles are in degrees, translations in the scene's unit.",
    )
    rotations: list[Axis] | None = Field(
        None,
        description="Of a custom joint, three at most, each going along with those before it: { axis = "
        "[0, 0, 1], coordinate = 'knee_angle', polynomial = [1.0, 0.0] }. Without a function it "
        "is the coordinate itself [degrees].",
    )
    translations: list[Axis] | None = Field(
        None,
        description="Of a custom joint, along axes of the parent, likewise [the scene's unit].",
    )


class OpenSimTable(Table):
    """A model of OpenSim that has the joints."""

    model: Text = Field(
        examples=["leg.osim"],
        description="An .osim file, of version 3 or 4. OpenSim itself is not needed.",
    )
    bodies: dict[str, Text] | None = Field(
        None,
        description="The body of each bone, { femur = 'femur_r' }. Bones that it does not name are the body "
        "of the same name.",
    )
    frame: Text | None = Field(
        None,
        examples=["pelvis"],
        description="The body whose frame is the scene's, in the rest pose. Without it the ground.",
    )
    fixed: Text | None = Field(
        None,
        examples=["pelvis"],
        description="The body that stays where it is; all others move against it. Without it the ground.",
    )
    rest: dict[str, Number] | None = Field(
        None,
        description="Coordinates in the rest pose, { hip_flexion_r = 1.576 }, in degrees or metres. Those "
        "that it does not name have their default value.",
    )


#: Where a muscle's greatest force comes from: given, or from its area.
_FORCE, _AREA = "max_isometric_force", ("pcsa", "specific_tension")


class Hill(Table):
    """What a muscle's fibres can do, for exports; a run uses two lengths for its architecture."""

    optimal_fibre_length: Number | None = Field(
        None, examples=[110.0], description="Length of the fibres at which they are strongest, in ``units``."
    )
    tendon_slack_length: Number | None = Field(
        None, examples=[310.0], description="Length of the tendon without force, in ``units``."
    )
    sarcomere_length: Number | None = Field(
        None,
        examples=[2.6],
        description="Mean length of the sarcomeres in the rest pose, in micrometres, whatever ``units``.",
    )
    pennation: Number | None = Field(
        None, examples=[12.0], description="Angle of the fibres to the tendon at that length, in degrees."
    )
    max_isometric_force: Number | None = Field(
        None, examples=[1100.0], description="In newtons. Or ``pcsa`` and ``specific_tension``."
    )
    pcsa: Number | None = Field(
        None, examples=[18.0], description="Physiological cross-sectional area, in cm^2, whatever ``units``."
    )
    specific_tension: Number | None = Field(
        None, examples=[61.0], description="Force per area, in N/cm^2; no value is taken where none is given."
    )

    @model_validator(mode="after")
    def _check(self) -> Hill:
        given = self.given()
        for name, value in given.items():
            if name == "pennation":
                if not 0.0 <= value < 90.0:
                    raise fault(f"pennation is {value:g}, but must be from 0 to less than 90 degrees", "")
            elif value <= 0.0:
                raise fault(f"{name} is {value:g}, but must be greater than 0", "")
        parts = [name for name in _AREA if name in given]
        if len(parts) == 1:
            (missing,) = set(_AREA) - set(parts)
            raise fault(f"{parts[0]} makes no force without {missing}", f"give {missing}, or {_FORCE}")
        if parts and _FORCE in given:
            raise fault(f"{_FORCE} cannot be combined with {' and '.join(_AREA)}", "give one or the other")
        return self

    def given(self) -> dict[str, float]:
        """Return what is given, by name."""
        return {name: float(value) for name, value in self.model_dump().items() if value is not None}
