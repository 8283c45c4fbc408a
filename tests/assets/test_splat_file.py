"""Files of splats: every format gives the cloud that was written, and what is wrong is told or counted."""

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.assets.readers.splat_columns import MOST_SPLATS
from dataset_builder.assets.splat_file import READERS, read_splats, upward
from dataset_builder.errors import UserError
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.geometry.splat_moves import moved, turn_matrices
from tests.assets.splat_files import (
    WRITERS,
    ball,
    box,
    gltf_maker,
    random_cloud,
    spz_bytes,
    write_ply,
    write_usda,
)

SETTINGS = settings(max_examples=120, deadline=None, derandomize=True, database=None,
                    suppress_health_check=[HealthCheck.function_scoped_fixture])


def assert_alike(found: SplatCloud, cloud: SplatCloud, *, place: float = 1e-5, size: float = 1e-5, turn: float = 1e-5,
                 opacity: float = 1e-5, colour: float = 1e-5) -> None:
    assert found.srgb == cloud.srgb and found.harmonics.shape == cloud.harmonics.shape
    assert np.abs(found.centres - cloud.centres).max() <= place
    assert np.abs(np.log(found.scales / cloud.scales)).max() <= size
    assert np.abs(turn_matrices(found.turns) - turn_matrices(cloud.turns)).max() <= turn
    assert np.abs(found.opacities - cloud.opacities).max() <= opacity
    assert np.abs(found.harmonics - cloud.harmonics).max() <= colour


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("suffix", [".ply", ".glb", ".usda"])
def test_what_is_written_is_read(tmp_path: Path, suffix: str, degree: int) -> None:
    cloud = random_cloud(degree=degree)
    WRITERS[suffix](tmp_path / f"a{suffix}", cloud)
    assert_alike(read_splats(tmp_path / f"a{suffix}").cloud, cloud)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
@pytest.mark.parametrize("version", [2, 3])
def test_spz_is_read_to_its_steps(tmp_path: Path, version: int, degree: int) -> None:
    """Half a step of each: 2^-12, e^(1/16), 1/255, 1/(0.15 * 255), 1/128; quaternions of 8 bits, where a small w that
    is left out is known to a tenth, and of 9."""
    cloud = random_cloud(degree=degree)
    (tmp_path / "a.spz").write_bytes(gzip.compress(spz_bytes(cloud, version=version)))
    found = read_splats(tmp_path / "a.spz")
    assert not found.notes
    assert_alike(found.cloud, cloud, place=0.51 / 4096, size=0.51 / 16, turn=0.25 if version == 2 else 0.01,
                 opacity=0.51 / 255, colour=0.51 / (0.15 * 255))


@pytest.mark.parametrize("shape", [ball(500), box(8)])
def test_all_formats_give_one_cloud(tmp_path: Path, shape: SplatCloud) -> None:
    for suffix, write in WRITERS.items():
        write(tmp_path / f"a{suffix}", shape)
        assert np.abs(read_splats(tmp_path / f"a{suffix}").cloud.centres - shape.centres).max() < 2e-4
    assert set(WRITERS) <= set(READERS)


def test_colour_spaces(tmp_path: Path) -> None:
    cloud = random_cloud(3)
    write_usda(tmp_path / "a.usda", cloud)
    assert read_splats(tmp_path / "a.usda").notes == ("/splats: no colour space is stated: colours taken as sRGB",)
    for space, srgb in (("lin_rec709_scene", False), ("srgb_rec709_scene", True)):
        write_usda(tmp_path / "a.usda", cloud, space=space)
        assert read_splats(tmp_path / "a.usda").cloud.srgb == srgb and not read_splats(tmp_path / "a.usda").notes
    write_usda(tmp_path / "a.usda", cloud, space="lin_ap1_scene")
    with pytest.raises(UserError, match="got lin_ap1_scene"):
        read_splats(tmp_path / "a.usda")
    gltf_maker(replace(cloud, srgb=False)).write(tmp_path / "a.glb")
    assert not read_splats(tmp_path / "a.glb").cloud.srgb and read_splats(tmp_path / "a.glb", srgb=True).cloud.srgb
    gltf_maker(cloud, space="bt2020").write(tmp_path / "a.glb")
    with pytest.raises(UserError, match="colorSpace: expected srgb_rec709_display or lin_rec709_display, got bt2020"):
        read_splats(tmp_path / "a.glb")


def test_nodes_and_stages_put_splats_somewhere(tmp_path: Path) -> None:
    cloud = random_cloud(20)
    quarter = np.array([[0, -2.0, 0, 1], [2, 0, 0, 0], [0, 0, 2, 0], [0, 0, 0, 1]])
    gltf_maker(cloud, rotation=[0, 0, 0.5**0.5, 0.5**0.5], scale=[2, 2, 2], translation=[1, 0, 0]).write(
        tmp_path / "a.glb")
    assert_alike(read_splats(tmp_path / "a.glb").cloud, moved(cloud, quarter), turn=1e-4, place=1e-4, colour=1e-4)
    write_usda(tmp_path / "a.usda", cloud, up="Z", metres=0.01)
    upright = np.array([[0.01, 0, 0, 0], [0, 0, 0.01, 0], [0, -0.01, 0, 0], [0, 0, 0, 1]])
    assert_alike(read_splats(tmp_path / "a.usda").cloud, moved(cloud, upright), turn=1e-4, place=1e-4, colour=1e-4)
    write_usda(tmp_path / "a.usda", cloud, half=True)
    assert_alike(read_splats(tmp_path / "a.usda").cloud, cloud, place=1e-3, size=1e-3, turn=5e-3, opacity=1e-3,
                 colour=1e-3)


def spoilt(cloud: SplatCloud, name: str, value: float, count: int) -> SplatCloud:
    array = getattr(cloud, name).copy()
    array[:count] = value
    return replace(cloud, **{name: array})


@pytest.mark.parametrize(("name", "value", "told"), [
    ("centres", np.nan, "3 splats with NaN or Inf, dropped"),
    ("harmonics", np.inf, "3 splats with NaN or Inf, dropped"),
    ("opacities", np.nan, "3 splats with NaN or Inf, dropped"),
    ("centres", 1e7, "3 splats beyond 1e+06 units, dropped"),
    ("turns", 0, "3 splats with a quaternion of zero, dropped"),
    ("scales", 0, "3 splats with scales of zero or less, dropped"),
    ("opacities", 0, "3 splats with an opacity below 1/255, dropped")])
@pytest.mark.parametrize("suffix", [".ply", ".glb", ".usda"])
def test_what_cannot_be_drawn_is_dropped_and_counted(tmp_path: Path, suffix: str, name: str, value: float,
                                                     told: str) -> None:
    cloud = random_cloud(20)
    WRITERS[suffix](tmp_path / f"a{suffix}", spoilt(cloud, name, value, 3))
    found = read_splats(tmp_path / f"a{suffix}")
    assert any(told in note for note in found.notes)
    assert np.allclose(found.cloud.centres, cloud.centres[3:], atol=1e-5)
    WRITERS[suffix](tmp_path / f"a{suffix}", spoilt(cloud, name, value, 20))
    with pytest.raises(UserError, match="expected splats that can be seen, got none: 20 splats"):
        read_splats(tmp_path / f"a{suffix}")


def test_needles_are_thickened_and_counted(tmp_path: Path) -> None:
    cloud = random_cloud(20)
    scales = cloud.scales.copy()
    scales[:4] = (0.5, 1e-7, 0.2)
    write_ply(tmp_path / "a.ply", replace(cloud, scales=scales))
    found = read_splats(tmp_path / "a.ply")
    assert found.notes == ("4 splats thinner than 0.001 of the length, made that thick",)
    assert np.allclose(found.cloud.scales[:4], (0.5, 5e-4, 0.2))


def test_lying_headers_and_too_many(tmp_path: Path) -> None:
    cloud = random_cloud(20)
    write_ply(tmp_path / "a.ply", cloud, count=30)
    with pytest.raises(UserError, match="expected 30 vertices, as the header declares, got 20; the file is cut short"):
        read_splats(tmp_path / "a.ply")
    write_ply(tmp_path / "a.ply", cloud, count=10)
    with pytest.raises(UserError, match="bytes of data, as the header declares"):
        read_splats(tmp_path / "a.ply")
    write_ply(tmp_path / "a.ply", cloud, count=10_000_000)
    with pytest.raises(UserError, match=r"got 10,000,000, which would take about 11.2 GiB of memory \(crop or prune"):
        read_splats(tmp_path / "a.ply")
    write_ply(tmp_path / "a.ply", cloud, count=0)
    with pytest.raises(UserError, match="expected splats, got none"):
        read_splats(tmp_path / "a.ply")
    for data, told in ((spz_bytes(cloud, count=30), "as the header says, got"),
                       (spz_bytes(cloud, count=MOST_SPLATS), "as the header says, got"),
                       (spz_bytes(cloud, count=2**32 - 1), "which would take about 4.7 TiB"),
                       (spz_bytes(cloud, more=b"x"), "as the header says, got more"),
                       (spz_bytes(cloud, version=5), "version 2 or 3, got magic 0x5053474e and version 5"),
                       (spz_bytes(cloud, degree=9), "harmonics of degree 0 to 4"), (b"", "header of 16 bytes")):
        (tmp_path / "a.spz").write_bytes(gzip.compress(data))
        with pytest.raises(UserError, match=told):
            read_splats(tmp_path / "a.spz")
    (tmp_path / "a.spz").write_bytes(spz_bytes(cloud, version=4))
    with pytest.raises(UserError, match="got a later one"):
        read_splats(tmp_path / "a.spz")


def test_flags_of_spz_are_told(tmp_path: Path) -> None:
    cloud = random_cloud(20)
    (tmp_path / "a.spz").write_bytes(gzip.compress(spz_bytes(cloud, flags=3, more=b"more")))
    assert read_splats(tmp_path / "a.spz").notes == ("extensions, not taken",
                                                     "trained with anti-aliasing, drawn without")


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n")
    with pytest.raises(UserError, match="expected Gaussian splats with a column"):
        read_splats(tmp_path / "a.ply")
    with pytest.raises(UserError, match="in a file that ends in one of"):
        read_splats(tmp_path / "a.ksplat")
    cloud = random_cloud(20)
    gltf_maker(cloud, kernel="ellipse2d").write(tmp_path / "a.glb")
    with pytest.raises(UserError, match="expected the kernel ellipse, got ellipse2d"):
        read_splats(tmp_path / "a.glb")
    gltf_maker(cloud, scale=[1, 0, 1]).write(tmp_path / "a.glb")
    with pytest.raises(UserError, match="keeps splats solid"):
        read_splats(tmp_path / "a.glb")
    write_usda(tmp_path / "a.usda", cloud, extra="double3 xformOp:scale = (1, 0, 1)\n"
               'uniform token[] xformOpOrder = ["xformOp:scale"]')
    with pytest.raises(UserError, match="keeps splats solid"):
        read_splats(tmp_path / "a.usda")
    write_usda(tmp_path / "a.usda", cloud, extra="float[] opacitiesh = []")
    with pytest.raises(UserError):
        write_usda(tmp_path / "b.usda", replace(cloud, opacities=cloud.opacities[:7]))
        read_splats(tmp_path / "b.usda")
    assert upward(tmp_path / "a.ply").tolist() == [0, -1, 0] and upward(tmp_path / "a.glb").tolist() == [0, 1, 0]


@pytest.mark.parametrize("suffix", [".ply", ".spz", ".glb"])
@SETTINGS
@given(cut=st.floats(0, 1), changes=st.lists(st.tuples(st.floats(0, 0.999), st.integers(0, 255)), max_size=6))
def test_damage_ends_in_a_cloud_or_a_clear_error(tmp_path: Path, suffix: str, cut: float,
                                                 changes: list[tuple[float, int]]) -> None:
    path = tmp_path / f"a{suffix}"
    data = bytearray(spz_bytes(random_cloud(5, degree=1)))
    if suffix != ".spz":
        WRITERS[suffix](path, random_cloud(5, degree=1))
        data = bytearray(path.read_bytes())
    for place, value in changes:
        data[int(place * len(data))] = value
    data = data[:int(cut * len(data))] if cut < 0.5 else data
    path.write_bytes(gzip.compress(bytes(data)) if suffix == ".spz" else bytes(data))
    try:
        cloud = read_splats(path).cloud
    except UserError:
        return
    assert len(cloud) and np.isfinite(cloud.harmonics).all() and (cloud.scales > 0).all()
    assert np.allclose(np.linalg.norm(cloud.turns, axis=1), 1, atol=1e-5)


def test_columns_that_are_not_read_are_told(tmp_path: Path) -> None:
    """Such as the filter of Mip-Splatting, without which splats look otherwise."""
    path = tmp_path / "a.ply"
    write_ply(path, ball(20, degree=1))
    assert not any("not taken" in note for note in read_splats(path).notes)
    whole = path.read_bytes()
    path.write_bytes(whole.replace(b"float nx\n", b"float filter_3D\n"))
    assert "columns filter_3D, not taken" in read_splats(path).notes
    path.write_bytes(whole.replace(b"float f_rest_8\n", b"float other\n"))
    with pytest.raises(UserError, match="expected three channels of harmonics, got 8 columns f_rest_"):
        read_splats(path)
