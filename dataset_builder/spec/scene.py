"""Rooms, objects and scenes as written: one YAML file each."""

from typing import Annotated, Literal

from pydantic import ConfigDict, Field, model_validator

from dataset_builder.spec.file_scene import SceneFileSpec
from dataset_builder.spec.hex_colour import MaybeColour
from dataset_builder.spec.licences import Licence
from dataset_builder.spec.model import Model, broken
from dataset_builder.spec.numbers import AnyNumber, within

FinishName = Literal["plaster", "paint", "boards", "tiles", "wood", "stone", "metal", "ceramic", "lacquer", "linen",
                     "velvet"]
MAX_SPECULAR = 0.16
"""Largest reflectance at normal incidence: that of an index of refraction of 7/3."""


class FogSpec(Model):
    """A homogeneous medium that fills the scene."""

    extinction: within(low=0, high=100) = 0.05  # type: ignore[valid-type]
    """Extinction coefficient per metre, scattering plus absorption (for short distances, the share of light lost per
    metre)."""
    albedo: within(low=0, high=1) = 0.9  # type: ignore[valid-type]
    """Share of the extinction that is scattered."""
    anisotropy: within(low=-0.95, high=0.95) = 0.0  # type: ignore[valid-type]
    """Mean cosine of the scattering angle (Henyey and Greenstein 1941)."""


class SurfaceSpec(Model):
    """Fields of a material; omitted ones are unchanged."""

    base_color: MaybeColour = None
    """Linear Rec.709 factors of reflectance, or sRGB as `"#rrggbb"`; of transmission where the surface transmits."""
    roughness: within(low=0, high=1) | None = None  # type: ignore[valid-type]
    """Perceptual; 0 is a mirror or clear glass."""
    metallic: within(low=0, high=1) | None = None  # type: ignore[valid-type]
    """1 is metal."""
    specular: within(low=0, high=MAX_SPECULAR) | None = None  # type: ignore[valid-type]
    """Reflectance of the dielectric part at normal incidence; 0.04 is an index of refraction of 1.5."""
    coat: within(low=0, high=1) | None = None  # type: ignore[valid-type]
    """Weight of a clear coat with index of refraction 1.5."""
    coat_roughness: within(low=0, high=1) | None = None  # type: ignore[valid-type]
    """Perceptual roughness of the coat."""
    sheen: MaybeColour = None
    """Colour of the sheen of fibres; 0 is none."""
    sheen_roughness: within(low=0.05, high=1) | None = None  # type: ignore[valid-type]
    """Roughness of the sheen."""
    emission: tuple[within(low=0, high=1e6), within(low=0, high=1e6), within(low=0, high=1e6)] | None = None  # type: ignore[valid-type]
    """Radiance that the surface sends out to both sides, in units of the source sky's; 0 switches it off."""


class MaterialSpec(SurfaceSpec):
    """Changes to a material of an object; omitted fields are unchanged."""

    transmission: within(low=0, high=1) | None = None  # type: ignore[valid-type]
    """Share of the light that passes the dielectric surface that is refracted instead of scattered; 1 is glass."""
    ior: within(low=1, high=3) | None = None  # type: ignore[valid-type]
    """Index of refraction of the transmitting part."""
    thin: bool | None = None
    """Whether the surface is a thin pane, which does not bend light."""
    abbe: within(low=0, high=100) | None = None  # type: ignore[valid-type]
    """Abbe number of the transmitting part, 20 (flint) to 85; 0 is no dispersion."""
    priority: Annotated[int, Field(ge=0, le=9)] | None = None
    """Of bodies of solid glass that take the same space, the one of the highest priority owns it: a bottle 2, what is
    in it 1. 0 takes no part: it has air around it."""
    alpha: within(low=0, high=1) | None = None  # type: ignore[valid-type]
    """Share of the surface that is there, times the alpha of its texture; the rest lets light and sight through."""
    plain: bool = False
    """Whether to ignore the material's texture."""


RoomRole = Literal["wall", "floor", "ceiling", "trim"]
"""Parts of a room that a material of its own may have."""


class RoomMaterialSpec(SurfaceSpec):
    """What a part of a room is finished with: a texture, a family of finishes, or a plain colour; further fields change
    it. With none of the three, they change what is drawn. No light passes it."""

    family: FinishName | None = None
    """A finish made in code; `base_color` multiplies its colours."""
    tone: str = ""
    """Which of the family's, as `oak` of boards; drawn if empty. An unknown one is an error that lists them."""
    texture: str = ""
    """Image (.png .jpg .webp .tif .exr), relative to this spec, that repeats; `base_color` multiplies it."""
    size: within(low=0.01, high=100) = 1.0  # type: ignore[valid-type]
    """Metres that one repeat of the texture covers, both ways."""

    @model_validator(mode="after")
    def _one_finish(self) -> "RoomMaterialSpec":
        for name, needs in (("tone", "family"), ("size", "texture")):
            if name in self.model_fields_set and not getattr(self, needs):
                raise broken(f"expected a `{needs}` beside `{name}`, the key is missing", path=(name,))
        if self.family and self.texture:
            raise broken("expected `family` or `texture`, got both", path=("texture",))
        return self


class RoomSpec(Model):
    """A room of drawn size, in metres."""

    width: within(low=1, high=100) = 5.0  # type: ignore[valid-type]
    """Metres along x."""
    depth: within(low=1, high=100) = 4.0  # type: ignore[valid-type]
    """Metres along y."""
    height: within(low=1.5, high=30) = 2.7  # type: ignore[valid-type]
    """Metres from floor to ceiling."""
    ceiling: bool = True
    """Whether the room has a ceiling."""
    windows: within(low=0, high=4) = 1.0  # type: ignore[valid-type]
    """Number of windows, at most one per wall; drawn numbers are rounded."""
    glazing: bool = False
    """Whether the windows have panes of thin glass; open holes otherwise."""
    skirting: within(low=0, high=0.5) = 0.08  # type: ignore[valid-type]
    """Height of the skirting boards in metres; 0 is none."""
    materials: dict[RoomRole, RoomMaterialSpec] = {}
    """What `wall`, `floor`, `ceiling` and `trim` (skirting, window frames and sills) are finished with; what is left
    out is drawn."""

    @model_validator(mode="after")
    def _material_is_used(self) -> "RoomSpec":
        if "ceiling" in self.materials and not self.ceiling:
            raise broken("expected no material of a ceiling in a room without one", path=("materials", "ceiling"))
        return self


class ObjectSpec(Model):
    """A piece of furniture: a family with parameters, or a mesh file."""

    family: str | None = None
    """Name of an embedded family; see `dataset-builder families`."""
    params: dict[str, AnyNumber] = {}
    """Parameters of the family that differ from its own distributions."""
    file: str | None = None
    """Mesh file (.glb .gltf .obj .off .ply .stl .npz .usd .usda .usdc .usdz), relative to this spec."""
    materials: dict[str, MaterialSpec] = {}
    """Changes by name of the material; `*` is every material. `dataset-builder families` lists the names of a family.
    An unknown name is an error that lists the known ones."""
    category: str = ""
    """If empty, taken from the family."""
    licence: Licence = ""
    """SPDX identifier, required with `file`; embedded furniture is CC0-1.0. In the label of every example with it."""
    scale: Annotated[float, Field(gt=0)] = 1.0
    """Factor from file units to metres; USD files state their units, and it multiplies the metres that they come to."""
    up: Literal["x", "y", "z"] = "y"
    """Axis of the file that points up; y in glTF. USD files state theirs, too, and come with y up whatever it is."""

    @model_validator(mode="after")
    def _one_source(self) -> "ObjectSpec":
        if (self.family is None) == (self.file is None):
            got = "neither" if self.file is None else "both"
            raise broken(f"expected exactly one of `family` and `file`, got {got}")
        if self.file is not None and self.params:
            raise broken("expected no parameters beside `file`, they belong to families", path=("params",))
        return self


class FurnitureSpec(Model):
    """Furniture of a scene, in addition to the target object."""

    object: str
    """Object file, relative to the scene file."""
    count: within(low=0, high=50) = 1.0  # type: ignore[valid-type]
    """Number of pieces; drawn numbers are rounded."""
    place: Literal["near", "wall", "floor"] = "floor"
    """near: close enough to the target to cast shadows on it. wall: with the back to a wall. floor: anywhere."""


class SceneSpec(Model):
    """A room or a scene file, and what is put into it."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": ["room"]}, {"required": ["file"]}]})

    room: str | None = None
    """Room file, relative to the scene file."""
    file: SceneFileSpec | None = None
    """A scene from a file, in place of a room."""
    furniture: tuple[FurnitureSpec, ...] = ()
    """Other furniture; pieces for which no free place is found are left out, with a note in the plan."""
    fog: FogSpec | None = None
    """A medium that fills the room; clear air if omitted."""
    target: Literal["near", "wall", "floor"] = "floor"
    """Where the target object stands; `near` is `floor`. Things of the scene itself stay where they are."""
    space: Annotated[float, Field(ge=0, le=100)] = 0.0
    """Metres of floor on all sides of the target that walls and furniture keep from, to look at it from all round.
    Furniture that is to stand nearer is left out."""

    @model_validator(mode="after")
    def _one_place(self) -> "SceneSpec":
        if (self.room is None) == (self.file is None):
            got = "neither" if self.file is None else "both"
            raise broken(f"expected exactly one of `room` and `file`, got {got}")
        return self
