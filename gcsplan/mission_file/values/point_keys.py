"""The forms of a place in a mission file: a list, a text, named numbers, or local metres.

Every form in degrees becomes `Degrees`, so that nothing else knows how it was written.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    WithJsonSchema,
    model_validator,
)

from gcsplan.mission_file.values.keys import FiniteMetres, Keys, Length
from gcsplan.mission_file.values.places import (
    LAT_LETTERS,
    LON_LETTERS,
    MAX_CHARS,
    PLACE_EXAMPLES,
    Degrees,
    read_angle,
    read_place,
)  # fmt: skip


class LocalPoint(Keys):
    """A point of a local frame, on the ground unless it has ``up_m`` or ``agl_m``."""

    east_m: FiniteMetres
    """East of the frame's origin."""
    north_m: FiniteMetres
    """North of the frame's origin."""
    up_m: FiniteMetres | None = None
    """Height above the frame's zero."""
    agl_m: Length | None = None
    """Height above ground."""

    @model_validator(mode="after")
    def _one_height(self) -> LocalPoint:
        if self.up_m is not None and self.agl_m is not None:
            raise ValueError("give up_m or agl_m, not both")
        return self


ALIASES = {"latitude": "lat", "longitude": "lon", "lng": "lon"}
"""Other names of the keys of a place in degrees."""


def _named_places(schema: dict[str, Any]) -> None:
    """Say in the JSON schema that a key of a place may have another name."""
    own: dict[str, Any] = schema["properties"]
    own.update({alias: own[key] for alias, key in ALIASES.items()})
    schema["required"] = [key for key in schema.get("required", []) if key not in ALIASES.values()]
    schema["allOf"] = [
        {"oneOf": [{"required": [name]} for name in (own_name, *(a for a, k in ALIASES.items() if k == own_name))]}
        for own_name in dict.fromkeys(ALIASES.values())
    ]


_ONE_OR_TWO_TEXTS = WithJsonSchema(
    {
        "anyOf": [
            {"type": "string", "maxLength": MAX_CHARS, "examples": list(PLACE_EXAMPLES)},
            {"type": "array", "items": {"type": "string"}, "minItems": 2, "maxItems": 2},
        ]
    }
)
_NUMBER_OR_TEXT = WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})


class DegreePoint(Keys):
    """A place by the names of its numbers; `latitude`, `longitude` and `lng` are understood, too."""

    model_config = ConfigDict(json_schema_extra=_named_places)

    lat: Annotated[float, BeforeValidator(partial(read_angle, letters=LAT_LETTERS)), _NUMBER_OR_TEXT]
    """Latitude in degrees, north is positive; or a text such as `47°23'49.5"N`."""
    lon: Annotated[float, BeforeValidator(partial(read_angle, letters=LON_LETTERS)), _NUMBER_OR_TEXT]
    """Longitude in degrees, east is positive; or a text such as `8°20'38.5"E`."""

    @model_validator(mode="before")
    @classmethod
    def _own_names(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        own: dict[str, Any] = {}
        for key, one in value.items():
            name = ALIASES[key] if key in ALIASES else key  # noqa: SIM401 (mypy)
            if name in own:
                raise ValueError(f"{name} stands twice, as {key} too; keep one")
            own[name] = one
        return own


class ViaDegreePoint(DegreePoint):
    """A via point by the names of its numbers."""

    agl_m: Length | None = None
    """Height above ground; if absent, the planner chooses it."""


class TextPoint(Keys):
    """A via point in any text form, with a height."""

    at: Annotated[str, Field(max_length=MAX_CHARS), AfterValidator(read_place)]
    """The place as text: degrees, UTM or MGRS."""
    agl_m: Length | None = None
    """Height above ground; if absent, the planner chooses it."""


def in_own_brackets(value: Any) -> Any:
    """A list of places as it is. Raises ValueError for one that is all numbers: each place has its own brackets."""
    if not isinstance(value, list) or not value or not all(type(v) in (int, float) for v in value):
        return value
    if len(value) % 2:
        raise ValueError(
            f"must be a list of places, each in brackets of its own: [[lat, lon], …], given {len(value)} numbers"
        )
    pairs = [f"[{value[i]}, {value[i + 1]}]" for i in range(0, min(len(value), 6), 2)]
    more = ", …" if len(value) > 6 else ""
    raise ValueError(f"must be a list of places, each in brackets of its own: [{', '.join(pairs)}{more}]")


def _form(value: Any) -> str:
    """The form of a place, by which it is judged."""
    if isinstance(value, str) or (isinstance(value, list) and len(value) == 2 and _all_text(value)):
        return "text"
    if not isinstance(value, dict):
        return "[lat, lon]"
    return "{lat, lon}" if any(key in value for key in (*ALIASES, *ALIASES.values())) else "{east_m, north_m}"


def _via_form(value: Any) -> str:
    if isinstance(value, dict) and "at" in value:
        return "{at, agl_m}"
    form = _form(value)
    return "{lat, lon, agl_m}" if form == "{lat, lon}" else form


def _all_text(values: list[Any]) -> bool:
    return all(isinstance(value, str) for value in values)


def _joined(value: Any) -> Any:
    """Latitude and longitude that are two texts as one; YAML reads ``[47°23'N, 8°20'E]`` so."""
    return ", ".join(value) if isinstance(value, list) else value


def _of_list(values: list[float]) -> Degrees:
    return Degrees(values[0], values[1], values[2] if len(values) > 2 else None)


def _of_keys(point: Any) -> Degrees:
    at = getattr(point, "at", None) or Degrees(*(getattr(point, key) for key in ("lat", "lon")))
    return replace(at, agl_m=getattr(point, "agl_m", None))


if TYPE_CHECKING:  # every form becomes one of these two
    LatLon = Degrees
    Point = Degrees | LocalPoint
    ViaPoint = Degrees | LocalPoint
else:
    _Local = Annotated[LocalPoint, Tag("{east_m, north_m}")]
    _List = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_of_list), Tag("[lat, lon]")]
    _ListAgl = Annotated[list[float], Field(min_length=2, max_length=3), AfterValidator(_of_list), Tag("[lat, lon]")]
    _Text = Annotated[str, BeforeValidator(_joined), AfterValidator(read_place), _ONE_OR_TWO_TEXTS, Tag("text")]
    _Named = Annotated[DegreePoint, AfterValidator(_of_keys), Tag("{lat, lon}")]
    _ViaNamed = Annotated[ViaDegreePoint, AfterValidator(_of_keys), Tag("{lat, lon, agl_m}")]
    _At = Annotated[TextPoint, AfterValidator(_of_keys), Tag("{at, agl_m}")]
    LatLon = Annotated[_List | _Text | _Named, Discriminator(_form)]
    # The first section of a union tells the other units of its keys, so LocalPoint with its heights is the first.
    Point = Annotated[_List | _Text | _Local | _Named, Discriminator(_form)]
    ViaPoint = Annotated[_ListAgl | _Text | _Local | _ViaNamed | _At, Discriminator(_via_form)]
POINT_FORMS: dict[str, type[Keys]] = {
    "{east_m, north_m}": LocalPoint, "{lat, lon}": DegreePoint, "{lat, lon, agl_m}": ViaDegreePoint,
    "{at, agl_m}": TextPoint,
}  # fmt: skip
"""The sections that are a place, by the form that messages and the reference call them."""
