"""Clouds of splats, and files of them in every format, written here from scratch."""

import gzip
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dataset_builder.geometry.splat_cloud import SplatCloud
from tests.assets.gltf_files import GltfMaker

SH0 = 0.28209479177387814


def directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors, evenly spread."""
    number = np.arange(count) + 0.5
    polar, azimuth = np.arccos(1 - 2 * number / count), np.pi * (1 + 5**0.5) * number
    return np.stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)], axis=1)


def facing(normals: np.ndarray) -> np.ndarray:
    """(N, 4) quaternions w, x, y, z that turn Z to (N, 3) unit vectors."""
    found = np.concatenate([1 + normals[:, 2:], np.cross([0, 0, 1.0], normals)], axis=1)
    found[normals[:, 2] < -0.999999] = (0, 1, 0, 0)
    return found / np.linalg.norm(found, axis=1, keepdims=True)


def on_surface(points: np.ndarray, normals: np.ndarray, colours: np.ndarray, size: float, *, degree: int = 3,
               opacity: float = 0.95, srgb: bool = True, seed: int = 0, gloss: float = 0.05) -> SplatCloud:
    """Flat splats at points, of (N, 3) encoded colours and some view dependence."""
    count = len(points)
    harmonics = np.zeros((count, (degree + 1)**2, 3))
    harmonics[:, 0] = (colours - 0.5) / SH0
    harmonics[:, 1:] = gloss * np.random.default_rng(seed).normal(size=(1, (degree + 1)**2 - 1, 3))
    single = {"centres": points, "scales": np.tile([size, size, 0.15 * size], (count, 1)), "turns": facing(normals),
              "opacities": np.full(count, opacity), "harmonics": harmonics}
    return SplatCloud(srgb=srgb, **{name: np.ascontiguousarray(value, np.float32) for name, value in single.items()})


def ball(count: int = 5000, radius: float = 1.0, **how: object) -> SplatCloud:
    """A ball of flat splats about the origin, striped."""
    n = directions(count)
    return on_surface(radius * n, n, 0.5 + 0.3 * np.sin(4 * n), 1.2 * radius * np.sqrt(4 * np.pi / count),
                      **how)  # type: ignore[arg-type]


def box(per_side: int = 40, half: tuple[float, float, float] = (0.5, 0.3, 0.8), **how: object) -> SplatCloud:
    """A box of flat splats about the origin, each side of one colour."""
    at = (np.arange(per_side) + 0.5) / per_side * 2 - 1
    u, v = (each.ravel() for each in np.meshgrid(at, at))
    points, normals, colours = [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            side = np.insert(np.stack([u, v], axis=1), axis, sign, axis=1)
            points.append(side * half)
            normals.append(np.tile(sign * np.eye(3)[axis], (len(side), 1)))
            colours.append(np.tile(0.5 + 0.35 * sign * np.eye(3)[axis], (len(side), 1)))
    return on_surface(np.concatenate(points), np.concatenate(normals), np.concatenate(colours),
                      1.2 * 2 * max(half) / per_side, **how)  # type: ignore[arg-type]


def random_cloud(count: int = 50, degree: int = 3, seed: int = 0) -> SplatCloud:
    """Splats of all sorts."""
    draws = np.random.default_rng(seed)
    turns = draws.normal(size=(count, 4))
    turns *= np.sign(turns[:, :1]) / np.linalg.norm(turns, axis=1, keepdims=True)
    single = {"centres": draws.uniform(-1, 1, (count, 3)), "scales": np.exp(draws.uniform(-4, -1, (count, 3))),
              "turns": turns, "opacities": draws.uniform(0.05, 0.99, count),
              "harmonics": draws.uniform(-0.9, 0.9, (count, (degree + 1)**2, 3))}
    return SplatCloud(**{name: value.astype(np.float32) for name, value in single.items()})


def write_ply(path: Path, cloud: SplatCloud, *, count: int | None = None) -> None:
    """As trainers write it; `count` for a header that lies."""
    rest = cloud.harmonics[:, 1:].transpose(0, 2, 1).reshape(len(cloud), -1)
    with np.errstate(divide="ignore", invalid="ignore"):
        rows = np.concatenate([
            cloud.centres, np.zeros((len(cloud), 3)), cloud.harmonics[:, 0], rest,
            np.log(cloud.opacities / (1 - cloud.opacities))[:, None], np.log(cloud.scales), 3 * cloud.turns], axis=1)
    names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{k}" for k in range(3)),
             *(f"f_rest_{k}" for k in range(rest.shape[1])), "opacity", *(f"scale_{k}" for k in range(3)),
             *(f"rot_{k}" for k in range(4))]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(cloud) if count is None else count}",
            *(f"property float {name}" for name in names), "end_header", ""]
    path.write_bytes("\n".join(head).encode() + rows.astype("<f4").tobytes())


def spz_bytes(cloud: SplatCloud, *, version: int = 3, flags: int = 0, count: int | None = None, more: bytes = b"",
              degree: int | None = None) -> bytes:
    """The stream before it is compressed."""
    def byte(values: np.ndarray) -> bytes:
        return np.clip(np.round(values), 0, 255).astype(np.uint8).tobytes()

    number = len(cloud)
    head = struct.pack("<IIIBBBB", 0x5053474E, version, number if count is None else count,
                       int(cloud.harmonics.shape[1]**0.5) - 1 if degree is None else degree, 12, flags, 0)
    fixed = np.round(cloud.centres * 4096).astype("<i4").reshape(-1, 1).view(np.uint8).reshape(-1, 4)[:, :3]
    xyzw = np.roll(cloud.turns.astype(np.float64), -1, axis=1)
    if version == 2:
        turns = byte(127.5 + 127.5 * xyzw[:, :3] * np.where(xyzw[:, 3:] < 0, -1, 1))
    else:
        packed = []
        for quaternion in xyzw:
            largest = int(np.argmax(np.abs(quaternion)))
            value = largest
            for axis in range(4):
                if axis != largest:
                    negative = (quaternion[axis] < 0) != (quaternion[largest] < 0)
                    value = value << 10 | negative << 9 | int(511 * abs(quaternion[axis]) * 2**0.5 + 0.5)
            packed.append(value)
        turns = np.array(packed, "<u4").tobytes()
    return b"".join([head, fixed.tobytes(), byte(255 * cloud.opacities),
                     byte(255 * (0.15 * cloud.harmonics[:, 0] + 0.5)),
                     byte(16 * (np.log(cloud.scales) + 10)), turns,
                     byte(128 + 128 * cloud.harmonics[:, 1:]), more])


def write_spz(path: Path, cloud: SplatCloud) -> None:
    path.write_bytes(gzip.compress(spz_bytes(cloud)))


def gltf_maker(cloud: SplatCloud, *, kernel: str = "ellipse", space: str | None = None, **node: object) -> GltfMaker:
    """A file whose only node has splats."""
    made, name = GltfMaker(), "KHR_gaussian_splatting"
    attributes = {"POSITION": made.accessor(cloud.centres), f"{name}:SCALE": made.accessor(cloud.scales),
                  f"{name}:ROTATION": made.accessor(np.roll(cloud.turns, -1, axis=1)),
                  f"{name}:OPACITY": made.accessor(cloud.opacities[:, None])}
    orders = [(d, n) for d in range(4) for n in range(2 * d + 1)]
    for (d, n), values in zip(orders, cloud.harmonics.transpose(1, 0, 2), strict=False):
        attributes[f"{name}:SH_DEGREE_{d}_COEF_{n}"] = made.accessor(np.ascontiguousarray(values))
    encoding = ("srgb_rec709_display" if cloud.srgb else "lin_rec709_display") if space is None else space
    made.add("meshes", primitives=[{"mode": 0, "attributes": attributes, "extensions": {
        name: {"kernel": kernel, "colorSpace": encoding}}}])
    made.add("nodes", mesh=0, **node)
    made.use(name, required=True)
    return made


def write_glb(path: Path, cloud: SplatCloud) -> None:
    gltf_maker(cloud).write(path)


def write_usda(path: Path, cloud: SplatCloud, *, half: bool = False, up: str = "Y", metres: float = 1.0,
               space: str = "", extra: str = "") -> None:
    """Text, so that nothing of OpenUSD has a hand in it."""
    def rows(values: np.ndarray) -> str:
        return "[" + ", ".join("(" + ", ".join(map(repr, row)) + ")" for row in values.tolist()) + "]"

    h, real = ("h", "half") if half else ("", "float")
    degree = int(cloud.harmonics.shape[1]**0.5) - 1
    api = ' (prepend apiSchemas = ["ColorSpaceAPI"])' if space else ""
    path.write_text(f"""#usda 1.0
(
    defaultPrim = "splats"
    metersPerUnit = {metres}
    upAxis = "{up}"
)
def ParticleField3DGaussianSplat "splats"{api}
{{
    {f'uniform token colorSpace:name = "{space}"' if space else ''}
    point3{h or 'f'}[] positions{h} = {rows(cloud.centres)}
    quat{h or 'f'}[] orientations{h} = {rows(cloud.turns)}
    {real}3[] scales{h} = {rows(cloud.scales)}
    {real}[] opacities{h} = {cloud.opacities.tolist()}
    uniform int radiance:sphericalHarmonicsDegree = {degree}
    {real}3[] radiance:sphericalHarmonicsCoefficients{h} = {rows(cloud.harmonics.reshape(-1, 3))}
    {extra}
}}
""")


WRITERS: dict[str, Callable[[Path, SplatCloud], None]] = {
    ".ply": write_ply, ".spz": write_spz, ".glb": write_glb, ".usda": write_usda}
