"""A field's file: what is written is read, the same field has the same bytes, and damage is told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import FieldFile, encode, read_field, write_field
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.splat_cloud import SplatCloud
from dataset_builder.label.field_record import FieldRecord

RECORD = FieldRecord(key="k", kind="density", truth=True, views=48, held_out=8, width=64, resolution=48, psnr=30.0,
                     psnr_worst=25.0, ssim=0.9, opacity_iou=0.95, silhouette_iou=0.96, level=0.1, bodies=1,
                     bodies_dropped=2, depth_95=0.02, loss=0.01)
MESH = TriangleMesh(positions=np.eye(3), faces=np.array([[0, 1, 2]]), uvs=np.zeros((1, 3, 2)), material=np.zeros(1),
                    colors=np.full((1, 3, 4), 0.5))

GRIDS = [np.zeros((4, 4, 4, 2), np.float32), np.zeros((4, 4, 3, 4), np.float32), np.zeros((4, 4, 4, 4)),
         np.full((4, 4, 4, 4), np.nan, np.float32)]


def made(seed: int = 0, splats: bool = False) -> FieldFile:
    draws = np.random.default_rng(seed)
    cloud = SplatCloud(centres=draws.normal(size=(5, 3)).astype(np.float32), scales=np.ones((5, 3), np.float32),
                       turns=np.tile(np.float32([1, 0, 0, 0]), (5, 1)), opacities=np.ones(5, np.float32),
                       harmonics=np.zeros((5, 4, 3), np.float32), srgb=False)
    return FieldFile(record=RECORD, mesh=MESH, centre=(0.0, 0.1, 0.4), radius=0.5, white=2.0,
                     grid=None if splats else draws.normal(size=(4, 4, 4, 4)).astype(np.float32),
                     splats=cloud if splats else None, numbers={"scale": 3.0}, more={"cells": np.ones((2, 2, 2), bool)})


@pytest.mark.parametrize("splats", [False, True])
def test_what_is_written_is_read(tmp_path: Path, splats: bool) -> None:
    content = made(splats=splats)
    write_field(tmp_path / "a.npz", content)
    found = read_field(tmp_path / "a.npz")
    assert encode(found) == encode(content) == (tmp_path / "a.npz").read_bytes()
    assert (found.record, found.centre, found.radius, found.white) == (RECORD, (0.0, 0.1, 0.4), 0.5, 2.0)
    assert np.array_equal(found.mesh.colors, MESH.colors) and found.numbers == {"scale": 3.0}
    assert (found.splats is None) != splats and (found.grid is None) == splats


def test_another_field_has_other_bytes() -> None:
    assert encode(made(0)) != encode(made(1))


@pytest.mark.parametrize("keep", [0, 10, 0.5, 0.99])
def test_damage_is_told(tmp_path: Path, keep: float) -> None:
    data = encode(made())
    (tmp_path / "a.npz").write_bytes(data[:int(keep if keep >= 1 else keep * len(data))])
    with pytest.raises(UserError, match="expected a whole field"):
        read_field(tmp_path / "a.npz")


def test_changed_bytes_are_told(tmp_path: Path) -> None:
    data = bytearray(encode(made()))
    data[len(data) // 2] ^= 255
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(UserError, match="expected a whole field"):
        read_field(tmp_path / "a.npz")


def test_a_missing_file_and_another_kind_are_told(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="found no file"):
        read_field(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", x=np.zeros(3))
    with pytest.raises(UserError, match="expected a whole field"):
        read_field(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", field=np.array([{"pickled": 1}], dtype=object))
    with pytest.raises(UserError, match="expected a whole field"):
        read_field(tmp_path / "c.npz")


@pytest.mark.parametrize(("name", "value"), [("radius", 0.0), ("radius", float("nan")), ("white", 0.0),
                                             ("centre", (0.0, float("inf"), 0.0)), ("centre", (0.0, 0.1)),
                                             ("numbers", {"scale": float("nan")}),
                                             *(("grid", grid) for grid in GRIDS)])
def test_numbers_that_no_field_has_are_refused(name: str, value: object) -> None:
    with pytest.raises(UserError, match=f"field: {name}: expected"):
        replace(made(), **{name: value})


def test_a_grid_has_a_scale() -> None:
    with pytest.raises(UserError, match="field: grid: expected finite numbers and their scale"):
        replace(made(), numbers={})


def test_no_byte_that_changes_ends_in_a_traceback(tmp_path: Path) -> None:
    data, draws = encode(made()), np.random.default_rng(0)
    names = data.index(b"PK\x01\x02")  # of members, and how each is compressed
    for place in (*range(names, len(data)), *draws.integers(names, size=200)):
        changed = bytearray(data)
        changed[place] ^= 255
        (tmp_path / "a.npz").write_bytes(changed)
        try:
            assert encode(read_field(tmp_path / "a.npz")) == data
        except UserError as error:
            assert "expected a whole field" in str(error)


@pytest.mark.parametrize("header", [b"[" * 100_000, b"[1]", b"{", b"\xff\xfe\x01", b'{"format": 1, "record": []}'])
def test_headers_that_say_nothing_are_told(tmp_path: Path, header: bytes) -> None:
    np.savez(tmp_path / "a.npz", field=np.frombuffer(header, np.uint8))
    with pytest.raises(UserError, match="expected a whole field"):
        read_field(tmp_path / "a.npz")


@pytest.mark.parametrize("value", [-0.1, 1.5, float("nan")])
def test_colours_are_shares(value: float) -> None:
    with pytest.raises(UserError, match=r"expected colours in \[0, 1\]"):
        replace(made(), mesh=replace(MESH, colors=np.full((1, 3, 4), value)))
