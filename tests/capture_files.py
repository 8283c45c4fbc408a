"""Captures as tests have them: a box with a ball on it, traced with NumPy, and written in every layout."""

import csv
import json
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

from dataset_builder.tonemap import srgb

BOX = np.array([[-0.35, -0.2, 0.0], [0.35, 0.2, 0.4]])
BALL, RADIUS = np.array([0.12, 0.0, 0.55]), 0.2
HEIGHT = 0.75
MIDDLE = np.array([0.0, 0.0, 0.35])
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
Bend = tuple[float, float, float, float]


def orbit(count: int = 24, distance: float = 2.0, arc: float = 360.0) -> np.ndarray:
    """(N, 4, 4) world-from-camera, OpenCV's axes, of level cameras around the object, two heights."""
    poses = []
    for index in range(count):
        azimuth = np.radians(-90 + arc * index / count)
        elevation = np.radians((15, 40)[index % 2])
        away = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
        forward, right = -away, np.cross(-away, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        turn = np.stack([right, np.cross(forward, right), forward], axis=1)
        poses.append(np.vstack([np.column_stack([turn, MIDDLE + distance * away]), [0, 0, 0, 1.0]]))
    return np.stack(poses)


def traced(origins: np.ndarray, ways: np.ndarray) -> np.ndarray:
    """(..., 4) linear colour times opacity, and opacity, of rays that see the object: matt, patterned, lit from
    above."""
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = np.sort((BOX[:, None] - origins.reshape(1, -1, 3)) / ways.reshape(1, -1, 3), axis=0)
    near, far = planes[0].max(axis=-1), planes[1].min(axis=-1)
    box = np.where((near < far) & (far > 0), near, np.inf)
    offset = BALL - origins.reshape(-1, 3)
    along = (ways.reshape(-1, 3) * offset).sum(axis=-1)
    inside = RADIUS**2 - (offset**2).sum(axis=-1) + along**2
    ball = np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0)), np.inf)
    reach = np.minimum(box, ball)
    seen = np.isfinite(reach)
    points = origins.reshape(-1, 3) + np.where(seen, reach, 0)[:, None] * ways.reshape(-1, 3)
    side = planes[0].argmax(axis=-1)
    flat = np.zeros_like(points)
    flat[np.arange(len(points)), side] = -np.sign(ways.reshape(-1, 3)[np.arange(len(points)), side])
    normals = np.where((ball < box)[:, None], (points - BALL) / RADIUS, flat)
    pattern = 0.25 + 0.2 * np.sin(21 * points + [0, 1, 2]) * np.sin(17 * points[:, [1, 2, 0]])
    light = 0.6 + 0.4 * normals @ np.array([0.3, -0.4, 0.85])
    colours = np.concatenate([pattern * light[:, None], np.ones((len(points), 1))], axis=1) * seen[:, None]
    return colours.reshape(*ways.shape[:-1], 4)


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """A capture in memory. Its frame may differ from the object's by a rotation and a scale."""

    poses: np.ndarray = field(default_factory=orbit)
    size: tuple[int, int] = (64, 64)
    focal: float = 96.0
    bend: Bend = (0.0, 0.0, 0.0, 0.0)
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))
    """Capture from object."""
    scale: float = 1.0
    """Units of the capture per metre."""
    shown: Callable[[int, np.ndarray], np.ndarray] = lambda index, rgba: rgba
    """What happens to an image's linear premultiplied pixels."""
    extension: str = ".png"

    @property
    def told(self) -> np.ndarray:
        """(N, 4, 4) poses in the capture's frame."""
        moved = self.poses.copy()
        moved[:, :3, :3] = self.turn @ self.poses[:, :3, :3]
        moved[:, :3, 3] = self.scale * self.poses[:, :3, 3] @ self.turn.T
        return moved

    def bent(self, ways: np.ndarray) -> np.ndarray:
        """Pixels of directions, written down again from OpenCV's page."""
        k1, k2, p1, p2 = self.bend
        x, y = ways[..., 0], ways[..., 1]
        r2 = x**2 + y**2
        there = np.stack([x * (1 + k1 * r2 + k2 * r2**2) + 2 * p1 * x * y + p2 * (r2 + 2 * x**2),
                          y * (1 + k1 * r2 + k2 * r2**2) + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y], axis=-1)
        return self.focal * there + np.array(self.size) / 2

    def image(self, index: int, over: int = 2) -> np.ndarray:
        """(H, W, 4) linear premultiplied pixels as the lens shows them, averages of `over` squared rays."""
        width, height = self.size
        columns, rows = np.meshgrid((np.arange(over * width) + 0.5) / over, (np.arange(over * height) + 0.5) / over)
        pixels = np.stack([columns, rows], axis=-1)
        ways = (pixels - np.array(self.size) / 2) / self.focal
        for _ in range(60 if any(self.bend) else 0):
            ways += (pixels - self.bent(ways)) / self.focal
        rays = np.concatenate([ways, np.ones_like(ways[..., :1])], axis=-1) @ self.poses[index, :3, :3].T
        rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
        rgba = traced(np.broadcast_to(self.poses[index, :3, 3], rays.shape), rays)
        return self.shown(index, rgba.reshape(height, over, width, over, 4).mean(axis=(1, 3)))

    def name(self, index: int) -> str:
        return f"view_{index:03d}{self.extension}"

    def write_images(self, folder: Path, masks: Path | None, *, alpha: bool = False,
                     names: Callable[[int], tuple[str, str]] | None = None) -> None:
        """8-bit sRGB images on grey, with masks in a folder of their own, or with alpha, or with neither."""
        for index in range(len(self.poses)):
            rgba = self.image(index)
            name, mask = names(index) if names else (self.name(index), f"{Path(self.name(index)).stem}.png")
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            cover = rgba[..., 3:]
            colour = rgba[..., :3] / np.maximum(cover, 1e-6) if alpha else rgba[..., :3] + 0.2 * (1 - cover)
            pixels = np.rint(255 * srgb(colour)).astype(np.uint8)
            grey = np.rint(255 * cover).astype(np.uint8)
            Image.fromarray(np.concatenate([pixels, grey], axis=-1) if alpha else pixels).save(folder / name)
            if masks is not None:
                (masks / mask).parent.mkdir(parents=True, exist_ok=True)
                Image.fromarray(grey[..., 0]).save(masks / mask)

    def write_transforms(self, folder: Path, *, masks: bool = True, alpha: bool = False, images: bool = True,
                         change: Callable[[dict], None] = lambda document: None) -> Path:
        """`transforms.json` as nerfstudio writes it."""
        if images:
            self.write_images(folder / "images", folder / "masks" if masks else None, alpha=alpha)
        frames = [{"file_path": f"images/{self.name(index)}", "transform_matrix": (pose @ FLIP).tolist()}
                  for index, pose in enumerate(self.told)]
        width, height = self.size
        document = {"camera_model": "OPENCV", "fl_x": self.focal, "fl_y": self.focal, "cx": width / 2,
                    "cy": height / 2, "w": width, "h": height, **dict(zip(("k1", "k2", "p1", "p2"), self.bend,
                                                                        strict=True)), "frames": frames}
        change(document)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "transforms.json").write_text(json.dumps(document))
        return folder

    def write_colmap(self, folder: Path, *, binary: bool = True, masks: bool = True, model: str = "OPENCV",
                     images: str = "images", points: np.ndarray | None = None, given: np.ndarray | None = None,
                     shots: bool = True) -> Path:
        """A sparse model; given: other camera-from-world matrices than the right ones."""
        if shots:
            self.write_images(folder / images, folder / "masks" if masks else None)
        sparse = folder / "sparse" / "0"
        sparse.mkdir(parents=True)
        world = np.linalg.inv(self.told) if given is None else given
        width, height = self.size
        cx, cy, (k1, k2, p1, p2) = width / 2, height / 2, self.bend
        number, values = {"SIMPLE_PINHOLE": (0, (self.focal, cx, cy)), "PINHOLE": (1, (self.focal, self.focal, cx, cy)),
                          "SIMPLE_RADIAL": (2, (self.focal, cx, cy, k1)), "RADIAL": (3, (self.focal, cx, cy, k1, k2)),
                          "OPENCV": (4, (self.focal, self.focal, cx, cy, k1, k2, p1, p2)),
                          "OPENCV_FISHEYE": (5, (self.focal, self.focal, cx, cy, k1, k2, p1, p2))}[model]
        points = np.zeros((0, 3)) if points is None else points
        if binary:
            (sparse / "cameras.bin").write_bytes(struct.pack("<QiiQQ", 1, 7, number, width, height)
                                                 + struct.pack(f"<{len(values)}d", *values))
            rows = b"".join(struct.pack("<i7di", index + 1, *quaternion(pose[:3, :3]), *pose[:3, 3], 7)
                            + self.name(index).encode() + b"\0" + struct.pack("<Q2dq", 1, 1.0, 2.0, -1)
                            for index, pose in enumerate(world))
            (sparse / "images.bin").write_bytes(struct.pack("<Q", len(world)) + rows)
            (sparse / "points3D.bin").write_bytes(struct.pack("<Q", len(points)) + b"".join(
                struct.pack("<Q3d3BdQ2i", index + 1, *point, 1, 2, 3, 0.5, 1, 1, 0) for index, point in
                enumerate(points)))
        else:
            (sparse / "cameras.txt").write_text(f"# cameras\n7 {model} {width} {height} "
                                                f"{' '.join(map(repr, values))}\n")
            (sparse / "images.txt").write_text("# images\n" + "".join(
                f"{index + 1} {' '.join(map(str, [*quaternion(pose[:3, :3]).tolist(), *pose[:3, 3].tolist()]))}"
                f" 7 {self.name(index)}\n{'1.0 2.0 -1' if index % 2 else ''}\n" for index, pose in enumerate(world)))
            (sparse / "points3D.txt").write_text("".join(
                f"{index + 1} {' '.join(map(str, point))} 1 2 3 0.5 1 0\n" for index, point in enumerate(points)))
        return folder

    def write_actors_hq(self, folder: Path, frame: int = 0) -> Path:
        """A rig's calibration and one frame of every camera."""
        def names(index: int) -> tuple[str, str]:
            camera = f"Cam{index + 1:03d}"
            return f"{camera}/{camera}_rgb{frame:06d}.png", f"{camera}/{camera}_mask{frame:06d}.png"

        self.write_images(folder / "rgbs", folder / "masks", names=names)
        width, height = self.size
        with (folder / "calibration.csv").open("w", newline="") as stream:
            rows = csv.writer(stream)
            rows.writerow(["name", "w", "h", "rx", "ry", "rz", "tx", "ty", "tz", "fx", "fy", "px", "py"])
            for index, pose in enumerate(self.told):
                w, *axis = quaternion(pose[:3, :3])
                length = np.linalg.norm(axis)
                turn = 2 * np.arctan2(length, w) * np.array(axis) / length
                rows.writerow([f"Cam{index + 1:03d}", width, height, *turn, *pose[:3, 3], self.focal / width,
                               self.focal / height, 0.5, 0.5])
        return folder


def quaternion(turn: np.ndarray) -> np.ndarray:
    """(4,) w, x, y, z of a rotation: the eigenvector of Bar-Itzhack (2000) with the largest eigenvalue."""
    (a, b, c), (d, e, f), (g, h, i) = turn
    k = np.array([[a - e - i, 0, 0, 0], [d + b, e - a - i, 0, 0], [g + c, h + f, i - a - e, 0],
                  [h - f, c - g, d - b, a + e + i]]) / 3
    _, vectors = np.linalg.eigh(k)
    x, y, z, w = vectors[:, -1]
    return np.array([w, x, y, z]) * (1 if w >= 0 else -1)


def tilted() -> np.ndarray:
    """A rotation that is none of the usual ones."""
    a, b = np.radians(130), np.radians(35)
    return np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]]) @ np.array(
        [[np.cos(b), -np.sin(b), 0], [np.sin(b), np.cos(b), 0], [0, 0, 1]])
