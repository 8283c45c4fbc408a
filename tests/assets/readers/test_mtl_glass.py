"""Glass of MTL: illumination models, until OBJ has a reader of its own."""

from pathlib import Path

import pytest

from dataset_builder.assets.asset import Material
from tests.assets.gltf_files import load

OBJ = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n"


def mtl(tmp_path: Path, text: str) -> Material:
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "a.mtl").write_text(f"newmtl m\n{text}\n")
    return load(tmp_path / "a.obj").materials[0]


@pytest.mark.parametrize(("text", "transmission", "thin"), [
    ("illum 7\nd 0.25\nNi 1.6", 0.75, False), ("illum 6\nTr 0.75", 0.75, False), ("illum 7\nd 1", 1.0, False),
    ("illum 6", 1.0, False), ("illum 7\nd 0", 1.0, False), ("illum 4\nd 0.25", 0.75, True),
    ("illum 9\nd 0", 1.0, True)])
def test_illumination_models_of_glass(tmp_path: Path, text: str, transmission: float, thin: bool) -> None:
    material = mtl(tmp_path, text)
    assert (material.transmission, material.thin, material.roughness) == (pytest.approx(transmission), thin, 0.0)
    assert material.ior == (1.6 if "Ni" in text else 1.5)
    assert material.specular == pytest.approx(((material.ior - 1) / (material.ior + 1)) ** 2)


@pytest.mark.parametrize("text", ["illum 2\nd 0.5\nNi 1.6", "d 0.5", "illum 4\nd 1", "illum 9"])
def test_other_models_keep_no_transparency(tmp_path: Path, text: str) -> None:
    material = mtl(tmp_path, text)
    assert (material.transmission, material.ior, material.specular) == (0, 1.5, 0.04)


@pytest.mark.parametrize(("text", "tint"), [
    ("Kd 0 0 0", (1, 1, 1)), ("Kd 0.5 0.6 0.7", (0.5, 0.6, 0.7)), ("Kd 0 0 0\nTf 0.1 0.2 0.3", (0.1, 0.2, 0.3))])
def test_tints_of_mtl_glass(tmp_path: Path, text: str, tint: tuple[float, float, float]) -> None:
    assert mtl(tmp_path, f"illum 7\n{text}").base_color == pytest.approx(tint)


def test_rough_mtl_glass_keeps_its_exponent(tmp_path: Path) -> None:
    assert mtl(tmp_path, "illum 7\nNs 6").roughness == pytest.approx(0.25**0.25)
