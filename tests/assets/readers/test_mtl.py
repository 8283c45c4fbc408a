"""MTL libraries: what they say of a material is honoured, named or refused."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dataset_builder.assets.asset import Material
from dataset_builder.assets.mesh_file import load_mesh_file
from dataset_builder.errors import UserError
from tests.assets.readers.wavefront_files import TRIANGLE, mtl, obj, png

GREY_200 = 0.5775804
"""sRGB 200 in linear light."""
NORMALS = [[[128, 128, 255], [218, 128, 218]]]
"""Upright, and tilted by 45 degrees along u: 218 is 0.707 of the way from 128 to 255."""


def load(path: Path):
    return load_mesh_file(path, name="thing", category="thing", licence="CC0-1.0")


def image(folder: Path, name: str = "w.png", texels=(((200, 200, 200),),)) -> None:
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_bytes(png(texels))


def material(folder: Path, text: str) -> Material:
    return mtl(folder, text).material


# Kd

@pytest.mark.parametrize(("text", "color"), [
    ("Kd 0.1 0.2 0.3", (0.1, 0.2, 0.3)), ("Kd 0.9", (0.9, 0.9, 0.9)), ("Kd 0.8 0.8 0.8 # light grey", (0.8,) * 3),
    ("kd\t0.1  0.2\t0.3\r", (0.1, 0.2, 0.3)), ("  Kd 1e-1 .2 +0.3", (0.1, 0.2, 0.3)), ("", (0.8,) * 3),
    ("Kd 0 0 1\nKd 1 0 0", (1, 0, 0))])
def test_the_colour_that_is_written(tmp_path, text, color):
    assert material(tmp_path, text).base_color == color


def test_a_byte_order_mark_and_latin_1(tmp_path):
    model = obj(tmp_path, TRIANGLE.replace("usemtl m", "usemtl gr\u00fcn").encode("latin-1"),
                a="\ufeffnewmtl gr\u00fcn\nKd 0 1 0\n".encode())
    assert model.materials[0].material.base_color == (0, 1, 0)
    model = obj(tmp_path, TRIANGLE.replace("usemtl m", "usemtl gr\u00fcn"),
                a="# \u00fc\r\nnewmtl gr\u00fcn\r\nKd 0 1 0\r\n".encode("latin-1"))
    assert model.materials[0].material.base_color == (0, 1, 0) and not model.left_out


def test_kd_multiplies_its_map_and_is_white_without_a_number(tmp_path):
    image(tmp_path)
    for text, factor in (("map_Kd w.png", 1.0), ("Kd 0.5\nmap_Kd w.png", 0.5)):
        found = material(tmp_path, text)
        assert found.base_color == (factor,) * 3
        np.testing.assert_allclose(found.texture.base_color, GREY_200, rtol=1e-5)


@pytest.mark.parametrize(("text", "words"), [
    ("Kd spectral a.rfl 1", "Kd as spectral"), ("Kd xyz 1 1 1", "Kd as xyz"), ("Kd 2 1 1", "Kd beyond 0 to 1"),
    ("Kd 0\nKd 1", "all but the last Kd"), ("Kd 0 0 0", "all black by its Kd 0 0 0, as the file says"),
    ("Kd 0 0 0\nmap_Kd w.png", "all black by its Kd 0 0 0 under map_Kd, as the file says"),
    ("map_Kd black.png", "all black under map_Kd, as the file says"), ("d 0", "invisible, as the file says"),
    ("aniso 0.5", "aniso"), ("anisor 0.1", "anisor"), ("Tf 0.5 1 1", "Tf"), ("disp w.png", "disp"),
    ("Pr 0.1\nTf 1 1 1", "Tf"),
    ("decal w.png", "decal"), ("refl -type sphere w.png", "refl"), ("map_Ns gone.png", "map_Ns"),
    ("map_Ka gone.png", "map_Ka"), ("sharpness 60", "sharpness"), ("d 0.5\nTr 0.3", "Tr, which contradicts d 0.5"),
    ("d -halo 0.5", "-halo of d"), ("Ks 0.1 0.5 0.5", "the colour of Ks"), ("foo 1", "foo"), ("map_Kd", "map_Kd"),
    ("map_Kd -mm 0.1 2 w.png", "-mm of map_Kd"), ("map_Kd -t 1 1 1 w.png", "-t of map_Kd"),
    ("map_Kd -cc on w.png", "-cc of map_Kd"), ("map_Kd -blendu off w.png", "-blendu of map_Kd"),
    ("map_Kd alpha.png", "coverage in the image of map_Kd, which no map_d names"),
    ("illum 3\nKs 0.5\nmap_Kd w.png", "illum 3 texel by texel: map_Kd tints what is reflected, too"),
    ("bump w.png", "bump, a map of heights"), ("map_Bump w.png\nnorm n.png", "map_Bump"),
    ("illum 6\nmap_d w.png", "map_d")])
def test_what_is_not_honoured_is_named(tmp_path, text, words):
    image(tmp_path)
    image(tmp_path, "black.png", [[[0, 0, 0]]])
    image(tmp_path, "alpha.png", [[[200, 200, 200, 100]]])
    image(tmp_path, "n.png", NORMALS)
    assert mtl(tmp_path, text).left_out == (words,)


@pytest.mark.parametrize("text", ["Ka 1 1 1\nKd 1\nKs 0.5 0.5 0.5\nNs 96\nNi 1.45\nd 1\nTr 0\nillum 2\nTf 1 1 1\n"
                                  "Ke 0 0 0\naniso 0\nanisor 0", "map_Kd -mm 0 1 -cc off -blendu on -blendv on w.png",
                                  "map_Kd alpha.png\nmap_d alpha.png", "Kd 0\nKe 1", "illum 1\nNi 1.5\nKs 0.5"])
def test_nothing_is_named_where_all_is_honoured(tmp_path, text):
    image(tmp_path)
    image(tmp_path, "alpha.png", [[[200, 200, 200, 100]]])
    assert mtl(tmp_path, text).left_out == ()


@pytest.mark.parametrize("text", ["Kd red", "Kd nan 0 0", "Kd 1 1", "Kd", "Ns high", "Ns inf", "d", "illum x",
                                  "map_Kd -o x w.png", "norm -bm x w.png"])
def test_values_that_are_no_numbers_are_refused_with_their_line(tmp_path, text):
    image(tmp_path)
    with pytest.raises(UserError, match=r"a\.mtl: line 2: expected .*number|not in"):
        obj(tmp_path, TRIANGLE, a=f"newmtl m\n{text}\n")
        load(tmp_path / "a.obj")


# Gloss and metal

@pytest.mark.parametrize(("text", "values"), [
    ("", (0.8, 0.0, 0.04)), ("Ns 6", (0.25**0.25, 0.0, 0.04)), ("Pr 0.3\nNs 6", (0.3, 0.0, 0.04)),
    ("Pm 1\nPr 0.2", (0.2, 1.0, 0.04)), ("Ks 0.5 0.5 0.5", (0.8, 0.0, 0.04)), ("Ks 0 0 0", (0.8, 0.0, 0.0)),
    ("Ks 1", (0.8, 0.0, 0.08)), ("illum 1", (0.8, 0.0, 0.0)), ("illum 0\nKs 1 1 1", (0.8, 0.0, 0.0)),
    ("illum 1\nPm 0.5", (0.8, 0.5, 0.04)), ("Ni 2", (0.8, 0.0, 1 / 9)), ("Ni 1", (0.8, 0.0, 0.04)),
    ("Ni 2\nKs 1", (0.8, 0.0, 0.16))])
def test_gloss_and_metal(tmp_path, text, values):
    found = material(tmp_path, text)
    assert (found.roughness, found.metallic, found.specular) == pytest.approx(values)


def test_mirrors_reflect_with_ks(tmp_path):
    """Chrome and gold of the classic kind, whose Kd is black, are metals of the colour of their Ks."""
    for ks in ((0.9, 0.9, 0.9), (1.0, 0.7, 0.3)):
        found = material(tmp_path, "illum 3\nKd 0 0 0\nNs 1000\nKs {} {} {}".format(*ks))
        assert found.metallic == pytest.approx(1) and found.base_color == pytest.approx(ks)
        assert mtl(tmp_path, "illum 3\nKd 0 0 0\nKs {} {} {}".format(*ks)).left_out == ()
        assert found.roughness == pytest.approx((2 / 1002)**0.25)
    assert material(tmp_path, "illum 3\nKs 0.9").roughness == 0


@pytest.mark.parametrize(("kd", "ks"), [(0.5, 0.04), (0.3, 0.3), (0.0, 0.5), (0.8, 0.15)])
def test_a_mirror_scatters_and_reflects_what_it_says(tmp_path, kd, ks):
    """F0 is Ks; the diffuse part is what the extension's formula leaves of Kd: Kd (1 - Ks)."""
    found = material(tmp_path, f"illum 3\nKd {kd}\nKs {ks}")
    base, metallic = found.base_color[0], found.metallic
    assert metallic * base + (1 - metallic) * 0.04 == pytest.approx(ks, abs=0.03)
    assert (1 - metallic) * base * 0.96 == pytest.approx(kd * (1 - ks), abs=0.03)


def test_maps_of_the_physical_extension(tmp_path):
    names = ("pr", "pm", "ps", "pc", "pcr")
    for number, name in enumerate(names):
        image(tmp_path, f"{name}.png", [[[51 * (number + 1)] * 3]])
    found = material(tmp_path, "".join(f"map_{name.capitalize()} {name}.png\n" for name in names))
    assert (found.roughness, found.metallic, found.sheen, found.coat, found.coat_roughness) == (1, 1, (1, 1, 1), 1, 1)
    values = [float(getattr(found.texture, name).mean())
              for name in ("roughness", "metallic", "sheen", "coat", "coat_roughness")]
    np.testing.assert_allclose(values, [0.2, 0.4, 0.6, 0.8, 1.0], rtol=1e-6)
    found = material(tmp_path, "Ps 0.3\nPc 0.6\nPcr 0.1\nPr 0.5\nmap_Pr pr.png\n")
    assert (found.sheen, found.coat, found.coat_roughness, found.roughness) == ((0.3,) * 3, 0.6, 0.1, 0.5)


def test_a_map_of_specular_reflection(tmp_path):
    image(tmp_path)
    found = material(tmp_path, "map_Ks w.png")
    assert found.specular == pytest.approx(0.08)
    np.testing.assert_allclose(found.texture.specular, GREY_200, rtol=1e-5)


# Light and coverage

def test_emission(tmp_path):
    image(tmp_path)
    assert material(tmp_path, "Ke 3 2 1").emission == (3, 2, 1)
    found = material(tmp_path, "Kd 0\nmap_Ke w.png")
    assert found.emission == (1, 1, 1)
    np.testing.assert_allclose(found.texture.emission, GREY_200, rtol=1e-5)


@pytest.mark.parametrize(("text", "alpha"), [
    ("d 0.3", 0.3), ("Tr 0.3", 0.7), ("d 0.3\nTr 0.7", 0.3), ("illum 2\nd 0.5\nNi 1.6", 0.5), ("", 1),
    ("illum 4\nd 1", 1)])
def test_what_is_dissolved_covers_less(tmp_path, text, alpha):
    found = material(tmp_path, text)
    assert found.alpha == pytest.approx(alpha) and found.transmission == 0 and found.alpha_cutoff is None


@pytest.mark.parametrize(("words", "expected"), [
    ("w.png", 100 / 255), ("grey.png", 200 / 255), ("-imfchan r w.png", 0.2), ("-imfchan m grey.png", 1.0),
    ("-imfchan l w.png", 0.2)])
def test_map_d_is_the_coverage_of_its_image_or_its_luminance(tmp_path, words, expected):
    image(tmp_path, "w.png", [[[51, 51, 51, 100]]])
    image(tmp_path, "grey.png")
    found = material(tmp_path, f"d 0.5\nmap_d {words}")
    assert found.alpha == 0.5 and found.texture.alpha == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("text", "transmission", "thin"), [
    ("illum 7\nd 0.25\nNi 1.6", 0.75, False), ("illum 6\nTr 0.75", 0.75, False), ("illum 7\nd 1", 1.0, False),
    ("illum 6", 1.0, False), ("illum 7\nd 0", 1.0, False), ("illum 4\nd 0.25", 0.75, True),
    ("illum 9\nd 0", 1.0, True)])
def test_illumination_models_of_glass(tmp_path, text, transmission, thin):
    found = material(tmp_path, text)
    assert (found.transmission, found.thin, found.roughness) == (pytest.approx(transmission), thin, 0.0)
    assert found.ior == (1.6 if "Ni" in text else 1.5) and found.alpha == 1
    assert found.specular == pytest.approx(((found.ior - 1) / (found.ior + 1)) ** 2)


@pytest.mark.parametrize(("text", "tint"), [
    ("Kd 0 0 0", (1, 1, 1)), ("Kd 0.5 0.6 0.7", (0.5, 0.6, 0.7)), ("Kd 0 0 0\nTf 0.1 0.2 0.3", (0.1, 0.2, 0.3)),
    ("", (1, 1, 1))])
def test_tints_of_glass(tmp_path, text, tint):
    assert material(tmp_path, f"illum 7\n{text}").base_color == pytest.approx(tint)


def test_rough_glass_keeps_its_exponent(tmp_path):
    assert material(tmp_path, "illum 7\nNs 6").roughness == pytest.approx(0.25**0.25)


# Maps

@pytest.mark.parametrize("key", ["norm", "map_Bump", "bump"])
def test_normal_maps_however_they_are_called(tmp_path, key):
    image(tmp_path, "n.png", NORMALS)
    normal = mtl(tmp_path, f"{key} n.png").material.texture.normal
    np.testing.assert_allclose(normal[0], [(0, 0, 1), (0.5**0.5, 0, 0.5**0.5)], atol=0.01)
    scaled = mtl(tmp_path, f"{key} -bm 0.5 n.png").material.texture.normal
    np.testing.assert_allclose(scaled[0, 1], (0.2**0.5, 0, 0.8**0.5), atol=0.01)


def test_black_and_grey_are_no_normals(tmp_path):
    image(tmp_path, "black.png", [[(0, 0, 0), (128, 128, 128)]])
    found = mtl(tmp_path, "norm black.png")
    assert found.material.texture is None
    assert found.left_out == ("norm, whose texels all point nowhere or into the surface (black or grey)",)
    image(tmp_path, "n.png", [[(0, 0, 0), *NORMALS[0]]])
    found = mtl(tmp_path, "norm n.png")
    np.testing.assert_allclose(found.material.texture.normal[0, 0], (0, 0, 1), atol=0.01)
    assert found.left_out[0].startswith("norm in 1 of 3 texels, which point nowhere")


def test_maps_are_scaled_shifted_and_clamped(tmp_path):
    image(tmp_path)
    found = mtl(tmp_path, "map_Kd -s 2 3 1 -o 0.25 -0.5 -clamp on w.png")
    np.testing.assert_array_equal(found.uv_transform, [(2, 0, 0.25), (0, 3, -0.5)])
    assert found.material.texture.wrap == ("clamp", "clamp") and found.left_out == ()
    plain = mtl(tmp_path, "map_Kd w.png")
    assert plain.uv_transform is None and plain.material.texture.wrap == ("repeat", "repeat")
    other = mtl(tmp_path, "map_Pr -s 4 4 w.png\nmap_Kd w.png\n")
    assert other.material.texture.roughness is None and other.material.roughness == 0.8
    assert other.left_out == ("map_Pr, whose -s, -o or -clamp differ from those of other maps",)


@pytest.mark.parametrize(("written", "name"), [
    ("old  oak.png", "old  oak.png"), ("./w.png", "w.png"), (".\\w.png", "w.png"), ("tex\\w.png", "tex/w.png"),
    ("h\u00f6lzern \u6728.png", "h\u00f6lzern \u6728.png"), ("old%20oak.png", "old oak.png"),
    ('"old oak.png"', "old oak.png"),
    ("w.png # wood", "w.png"), ("w#1.png", "w#1.png"), ("100%.png", "100%.png"), ("C:\\Users\\me\\tex\\w.png", "w.png"),
    ("/home/me/w.png", "w.png"), ("-bm 1 -s 1 1 1 4k wood.png", "4k wood.png")])
def test_names_of_images_as_they_are_written(tmp_path, written, name):
    image(tmp_path, name)
    (tmp_path / "a.obj").write_text(TRIANGLE)
    (tmp_path / "a.mtl").write_text(f"newmtl m\nmap_Kd {written}\n")
    asset = load(tmp_path / "a.obj")
    np.testing.assert_allclose(asset.materials[0].texture.base_color, GREY_200, rtol=1e-5)


def test_a_missing_image_is_refused_with_its_line_and_what_is_there(tmp_path):
    image(tmp_path, "Wood.PNG")
    (tmp_path / "a.obj").write_text(TRIANGLE)
    (tmp_path / "a.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd wood.png\nmap_Pr gone.png\n")
    with pytest.raises(UserError) as caught:
        load(tmp_path / "a.obj")
    first, second = map(str, caught.value.problems)
    assert "a.mtl: line 3: map_Kd: expected an existing file, got wood.png" in first and "Wood.PNG is there" in first
    assert "a.mtl: line 4: map_Pr: expected an existing file, got gone.png" in second


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo, lambda path: path.symlink_to(path.name)],
                         ids=["folder", "pipe", "circle"])
def test_what_is_there_and_no_file_is_said_to_be_none(tmp_path, make):
    make(tmp_path / "w.png")
    (tmp_path / "a.obj").write_text(TRIANGLE)
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd w.png\n")
    with pytest.raises(UserError, match=r"what is there is no plain file"):
        load(tmp_path / "a.obj")


@pytest.mark.parametrize("written", ["../w.png", "tex/../../w.png", "link.png", "..\\w.png"])
def test_no_image_outside_the_folder_is_opened(tmp_path, written):
    image(tmp_path)
    (folder := tmp_path / "chair").mkdir()
    (folder / "link.png").symlink_to("../w.png")
    with pytest.raises(UserError, match=r"a\.mtl: line 2: map_Kd: expected the name of a file in .*which is outside"):
        mtl(folder, f"map_Kd {written}")
    (folder / "a.mtl").unlink()
    (tmp_path / "out.mtl").write_text("newmtl m\n")
    with pytest.raises(UserError, match=r"a\.obj: line 1: mtllib: expected the name of a file in"):
        obj(folder, TRIANGLE.replace("a.mtl", "../out.mtl"))


# Whatever the bytes are

VALID = (b"newmtl m\nKd 0.5 0.5 0.5\nKs 0.5\nNs 20\nd 0.5\nillum 2\nmap_Kd -s 1 2 -o 0 0 w.png\n"
         b"norm -bm 1 w.png\nPr 0.4\n")
WORDS = [b"Kd", b"Ks", b"Ns", b"d", b"Tr", b"illum", b"map_d", b"bump", b"Tf", b"Ke", b" ", b"\n", b"0", b"1", b"-1",
         b"7", b"1e308", b"nan", b"-s", b"-o", b"-bm", b"-imfchan", b"w.png", b"../x", b"\xff", b"\0", b"#", b"3",
         b"newmtl m\n"]


@settings(max_examples=300, deadline=None, derandomize=True, database=None,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(edits=st.lists(st.tuples(st.integers(0, len(VALID) - 1), st.integers(0, 12), st.sampled_from(WORDS)),
                      max_size=5),
       tail=st.lists(st.sampled_from(WORDS), max_size=20).map(b" ".join))
def test_any_library_ends_in_an_asset_or_a_clear_error(tmp_path, edits, tail):
    image(tmp_path)
    data = VALID + tail
    for place, length, word in edits:
        data = data[:place] + word + data[place + length:]
    (tmp_path / "a.obj").write_text(TRIANGLE)
    (tmp_path / "a.mtl").write_bytes(data)
    try:
        asset = load(tmp_path / "a.obj")
    except UserError as error:
        assert "expected" in str(error)
    else:
        found = asset.materials[0]
        numbers = [*found.base_color, found.roughness, found.metallic, found.specular, found.alpha, found.transmission]
        assert all(0 <= number <= 1 for number in numbers) and np.isfinite(found.emission).all()
