"""Pictures of meshes: what is drawn where, and in which colour."""

import numpy as np
import pytest

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.rendering.scene.triangle_soup import MATT, Soup
from dataset_builder.report.looking.mesh_panels import MARGIN, Eye, mesh_panel

SIZE, HALF = 100, 0.3
WHITE = 255
COLOURS = np.array([(10, 20, 30), (200, 100, 0), (0, 90, 250)], np.uint8)


def square(at: float = 5.0) -> Soup:
    """A square of sides 2 `HALF` along y and z about (`at`, 1, 2), that looks to -x."""
    y, z = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]).T * HALF
    corners = np.stack([np.full(4, at), 1 + y, 2 + z], axis=1)[[[0, 2, 1], [0, 3, 2]]]
    return Soup(corners=corners, normals=np.tile((-1.0, 0, 0), (2, 3, 1)), uvs=np.zeros((2, 3, 2)),
                material=np.zeros(2), instance=np.ones(2), part=np.zeros(2), materials=(MATT,))


def eye(away: float = 4.0, *others: Soup) -> Eye:
    """That of a camera in front of the square, which aims past it."""
    camera = Pinhole(position=np.array([5 - away, 1.0, 2.0]), target=np.array([5.0, 1.5, 2.5]), fov=50, width=80,
                     height=60)
    return Eye.of(camera, [square(), *others])


def covered(pixels: np.ndarray) -> tuple[int, int, int, int]:
    """First and last row and column that are not white."""
    rows, columns = np.nonzero((pixels < WHITE - 20).any(axis=2))
    return rows.min(), rows.max(), columns.min(), columns.max()


@pytest.mark.parametrize("away", [4.0, 0.5])
def test_the_object_fills_the_frame(away: float) -> None:
    """Half the frame is the tangent of the angle whose sine is `MARGIN` radii over the distance, which is 2.5 radii at
    least; half the side is the tangent of its own."""
    radius = HALF * np.sqrt(2)
    distance = max(away, 2.5 * radius)
    half = SIZE / 2 * (HALF / distance) / np.tan(np.arcsin(MARGIN * radius / distance))
    expected = [SIZE / 2 - half, SIZE / 2 + half - 1] * 2
    assert np.abs(np.subtract(covered(mesh_panel(square(), eye(away), SIZE)), expected)).max() <= 1


def test_meshes_that_are_seen_together_may_be_compared() -> None:
    """A square further away is smaller by that much, in the same frame."""
    together = eye(4.0, square(6.0))
    near, far = (covered(mesh_panel(square(at), together, SIZE)) for at in (5.0, 6.0))
    sides = [np.subtract(found[1::2], found[::2]) + 1 for found in (near, far)]
    assert np.abs(sides[1] * 5 / 4 - sides[0]).max() <= 2


def test_values_have_their_colours() -> None:
    for value, colour in ((0.0, COLOURS[0]), (0.5, COLOURS[1]), (1.0, COLOURS[2]), (7.0, COLOURS[2])):
        pixels = mesh_panel(square(), eye(), SIZE, np.full((2, 3), value), COLOURS)
        assert np.abs(pixels[SIZE // 2, SIZE // 2].astype(int) - colour).max() <= 1


def test_values_run_between_corners() -> None:
    """Low at the lower edge, high at the upper one."""
    soup = square()
    pixels = mesh_panel(soup, eye(), SIZE, (soup.corners[..., 2] - 2 + HALF) / (2 * HALF), COLOURS)
    top, bottom, _, _ = covered(pixels)
    shown = [pixels[row, SIZE // 2].tolist() for row in (bottom - 3, (top + bottom) // 2 + 1, top + 3)]
    assert np.abs(np.array(shown) - COLOURS).max() <= 1


def test_one_side_is_as_bright_as_the_other() -> None:
    """Meshes of others are not always wound the same way."""
    soup = square()
    turned = Soup(corners=soup.corners[:, ::-1], normals=soup.normals, uvs=soup.uvs, material=soup.material,
                  instance=soup.instance, part=soup.part, materials=soup.materials)
    one, other = (mesh_panel(each, eye(), SIZE)[SIZE // 2, SIZE // 2].astype(int) for each in (soup, turned))
    assert np.abs(one - other).max() <= 2 and one.min() > 60
