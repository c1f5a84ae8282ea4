"""Hill's parameters of a muscle, as a scene gives them."""

from __future__ import annotations

from pydantic import Field, model_validator

from vtkmuscle.scene.joint_schema import Number
from vtkmuscle.scene.schema_types import Table
from vtkmuscle.scene.settings import fault

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
