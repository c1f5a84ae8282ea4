"""Tables of settings in a scene file: each key is a parameter of a filter, checked by its declaration."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, WithJsonSchema, create_model
from pydantic_core import PydanticCustomError

from vtkmuscle.core.words import shown
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.pipelines import FIBRE_SETTINGS, TRANSPORT_SETTINGS

_TYPES = {bool: "boolean", int: "integer", float: "number", str: "string", tuple: "array"}


def fault(problem: str, remedy: str) -> PydanticCustomError:
    """Return the error that a validator raises, with the fields of a SceneError."""
    return PydanticCustomError("fault", "{problem}", {"problem": problem, "remedy": remedy})


class Settings(BaseModel):
    """A table of settings, of which only those that are given count."""

    model_config = ConfigDict(extra="forbid")
    #: Settings that there were once, and what to do without each.
    gone: ClassVar[Mapping[str, str]] = {}

    def given(self) -> dict[str, Any]:
        """Return the settings that the table has."""
        return {
            name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set
        }


def _checked(declaration: Parameter[Any], value: Any) -> Any:
    try:
        declaration.check(value, "")
    except ValueError:
        problem = f"{shown(value)} is not allowed"
        raise fault(problem, f"it must be {declaration.allowed}") from None
    return value


def _schema_of(declaration: Parameter[Any]) -> dict[str, Any]:
    """Return the JSON schema of a parameter."""
    if declaration.choices:
        return {"enum": list(declaration.choices)}
    schema: dict[str, Any] = {"type": _TYPES[declaration.kind]}
    if declaration.kind is tuple:
        return (
            schema
            | {"items": {"type": "number"}}
            | _some(minItems=declaration.length, maxItems=declaration.length)
        )
    bounds = _some(
        minimum=declaration.minimum, maximum=declaration.maximum, exclusiveMinimum=declaration.above
    )
    return schema | bounds | _some(default=declaration.default)


def _some(**values: Any) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value is not None}


def _settings(name: str, declarations: Mapping[str, Parameter[Any]], doc: str) -> type[Settings]:
    fields: dict[str, Any] = {}
    for word, declaration in declarations.items():
        unit = declaration.units.replace("mm", "units")  # lengths in a scene are in its unit
        doc_of = declaration.doc + (f" [{unit}]" if unit else "")
        kind = Annotated[
            Any,
            PlainValidator(partial(_checked, declaration)),
            WithJsonSchema(_schema_of(declaration) | {"description": doc_of}),
        ]
        fields[word] = (kind, Field(None))
    return create_model(name, __base__=Settings, __doc__=doc, **fields)


if TYPE_CHECKING:
    Solver = Settings
    Fixing = Settings
    Fibres = Settings
else:
    Solver = _settings("Solver", PBDDeformer.parameter_declarations, "Those of PBDDeformer.")
    Solver.gone = PBDDeformer.gone
    Fixing = _settings("Fixing", FixedPointDetector.parameter_declarations, "Those of FixedPointDetector.")
    Fibres = _settings(
        "Fibres",
        {
            word: kind.parameter_declarations[parameter]
            for word, (kind, parameter) in (FIBRE_SETTINGS | TRANSPORT_SETTINGS).items()
        },
        "Settings of a muscle's fibres: those of vtkmuscle.pipelines.decompose, and weight_tolerance of "
        "FibreTransport.",
    )
