"""Numbers and lists that keys of several tables take."""

from typing import Annotated

from pydantic import AfterValidator, Field

from elastune.forms.expressions import check

Finite = Annotated[float, Field(allow_inf_nan=False)]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]
Count = Annotated[int, Field(ge=1)]

# A number, or an expression of x, y and z as text.
Entry = Finite | Annotated[str, AfterValidator(check)]
