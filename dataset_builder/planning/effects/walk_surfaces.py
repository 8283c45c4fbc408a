"""What paths meet that planning traces itself: every face of a scene with what its material is there."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dataset_builder.assets.asset import Asset, Material, Texture, cutoff_in_half, is_solid, see_through
from dataset_builder.geometry.raycast import RayScene

LIFT = 1e-4
"""Metres from a surface that paths go on from."""
FACTORS = {"base_color": 3, "emission": 3, "sheen": 3, "roughness": 1, "metallic": 1, "specular": 1, "transmission": 1,
           "coat": 1, "alpha": 1}
"""Of a material that texels multiply, and their channels."""


@dataclass(frozen=True, kw_only=True, eq=False)
class WalkPart:
    """One asset in the world."""

    asset: Asset
    positions: np.ndarray
    """(V, 3) of its mesh in the world."""
    mirrored: bool = False
    """Whether the way into the world turns the winding of its faces."""
    target: bool = False
    """Whether it is what the example is about."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Met:
    """The first surfaces along N rays; of rays that met none, values mean nothing. What the materials are there is
    looked up when it is asked for."""

    surfaces: "WalkSurfaces"
    face: np.ndarray
    """(N,) number of the face; -1 where there is none."""
    distance: np.ndarray
    """(N,) metres; inf where there is none."""
    share: np.ndarray
    """(N, 3) of the face's corners."""

    @property
    def there(self) -> np.ndarray:
        """(N,) whether there is one."""
        return self.face >= 0

    @property
    def target(self) -> np.ndarray:
        """(N,) whether it is the target's."""
        found: np.ndarray = self.surfaces.targets[self.face]
        return found

    @property
    def normal(self) -> np.ndarray:
        """(N, 3) unit, out of the face as it winds."""
        found: np.ndarray = self.surfaces.normals[self.face]
        return found

    @cached_property
    def factors(self) -> dict[str, np.ndarray]:
        """(N,) or (N, 3) by name of FACTORS, with `ior`, `thin` and `coverage`."""
        return self.surfaces.factors(np.maximum(self.face, 0), self.share)

    def of(self, keep: np.ndarray) -> "Met":
        """Some of them."""
        return Met(surfaces=self.surfaces, face=self.face[keep], distance=self.distance[keep], share=self.share[keep])


class WalkSurfaces:
    """All faces of a scene, as rays meet them. Normals are those of faces; texels are read one by one."""

    def __init__(self, parts: Sequence[WalkPart]):
        materials, chosen, corners, uvs, colours, targets, clear = list[Material](), [], [], [], [], [], []
        for part in parts:
            mesh, order = part.asset.mesh, [0, 2, 1] if part.mirrored else [0, 1, 2]
            corners.append(part.positions[mesh.faces[:, order]])
            uvs.append(mesh.uvs[:, order])
            colours.append(None if mesh.colors is None else mesh.colors[:, order])
            chosen.append(mesh.material + len(materials))
            targets.append(np.full(len(mesh.faces), part.target))
            clear.append(see_through(part.asset))
            materials += part.asset.materials
        self._materials, self._chosen = materials, np.concatenate(chosen)
        self._corners, self._uvs = np.concatenate(corners), np.concatenate(uvs)
        self._colours = None if all(each is None for each in colours) else np.concatenate(
            [np.ones((len(own), 3, 4), np.float32) if each is None else each
             for own, each in zip(corners, colours, strict=True)])
        self.targets, clear_faces = np.concatenate(targets), np.concatenate(clear)
        edge = self._corners[:, 1:] - self._corners[:, :1]
        normals = np.cross(edge[:, 0], edge[:, 1])
        self.normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
        self._table = {name: np.array([getattr(each, name) for each in materials], dtype=np.float64)
                       for name in (*FACTORS, "ior", "thin")}
        self._table["ior"] = np.maximum(self._table["ior"], 1.0)
        self._cutoff = np.array([np.nan if each.alpha_cutoff is None else cutoff_in_half(each.alpha_cutoff)
                                 for each in materials])
        self._textured = np.array([each.texture is not None for each in materials])
        self.glow = any(any(each.emission) for each in materials)
        """Whether some surface sends out light."""
        self._solid = np.array([is_solid(each) for each in materials])
        self._all = _rays(self._corners)
        self._opaque = _rays(self._corners[~clear_faces]) if clear_faces.any() else self._all
        self._clear_faces = np.flatnonzero(clear_faces)
        self._clear = _rays(self._corners[clear_faces])

    @property
    def bytes(self) -> int:
        """About, with what the ray tracer keeps."""
        return 600 * len(self._corners)

    @property
    def extent(self) -> tuple[np.ndarray, np.ndarray]:
        """(3,) low and (3,) high corner of all of it."""
        return self._corners.min(axis=(0, 1)), self._corners.max(axis=(0, 1))

    def meet(self, origins: np.ndarray, directions: np.ndarray) -> Met:
        """The first surfaces along rays from (N, 3) origins along unit directions (N, 3)."""
        face, distance, share = self._all.met(origins, directions)
        return Met(surfaces=self, face=face, distance=distance, share=share)

    def between(self, origins: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of straight ways from (N, 3) to (N, 3): (N,) share of light that nothing keeps back, as if glass bent none;
        (N,) surfaces of solid glass on the way."""
        passed = np.where(self._opaque.occluded(origins, ends, epsilon=LIFT), 0.0, 1.0)
        crossed = np.zeros(len(origins), np.int64)
        open_ways = np.flatnonzero(passed)
        if not len(self._clear_faces) or not len(open_ways):
            return passed, crossed
        along = ends[open_ways] - origins[open_ways]
        ray, face, at, share = self._clear.hits_within(origins[open_ways], along)
        within = (at > 0) & (at < 1)
        ray, face, share = open_ways[ray[within]], self._clear_faces[face[within]], share[within]
        factors = self.factors(face, share)
        solid = self._solid[self._chosen[face]]
        reflected = ((factors["ior"] - 1) / (factors["ior"] + 1)) ** 2
        through = factors["transmission"] * (1 - factors["metallic"]) * (1 - reflected)
        np.multiply.at(passed, ray, 1 - factors["coverage"] * (1 - through))
        np.add.at(crossed, ray[solid & (through > 0)], 1)
        return passed, crossed

    def factors(self, face: np.ndarray, share: np.ndarray) -> dict[str, np.ndarray]:
        """What the material is on faces (N,) at shares (N, 3) of their corners."""
        chosen = self._chosen[face]
        found = {name: values[chosen] for name, values in self._table.items()}
        if self._colours is not None:
            colour = np.einsum("nk,nkc->nc", share, self._colours[face])
            found["base_color"], found["alpha"] = found["base_color"] * colour[:, :3], found["alpha"] * colour[:, 3]
        textured = np.flatnonzero(self._textured[chosen])
        for index in np.unique(chosen[textured]).tolist():
            texture = self._materials[index].texture
            own = textured[chosen[textured] == index]
            row, column = _texel(texture, np.einsum("nk,nkc->nc", share[own], self._uvs[face[own]]))
            for name in FACTORS:
                if (texels := getattr(texture, name)) is not None:
                    # What is not a number counts as 1
                    found[name][own] *= np.maximum(np.fmin(texels[row, column], 1), 0)
        cutoff = self._cutoff[chosen]
        found["coverage"] = np.where(np.isnan(cutoff), found["alpha"], found["alpha"] >= cutoff)
        return found


def _rays(corners: np.ndarray) -> RayScene:
    return RayScene([(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), 1)])


def _texel(texture: Texture, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) rows and (N,) columns of the texels that texture coordinates (N, 2) lie in."""
    height, width = texture.base_color.shape[:2]
    places = []
    for value, wrap in zip(uv.T, texture.wrap, strict=True):
        folded = np.abs((value - 1) % 2 - 1) if wrap == "mirror" else value % 1 if wrap == "repeat" else value
        places.append(np.clip(folded, 0, 1))
    column, row = (np.minimum((place * size).astype(np.int64), size - 1)
                   for place, size in ((places[0], width), (1 - places[1], height)))
    return row, column
