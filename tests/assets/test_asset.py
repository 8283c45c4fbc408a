"""What is glass follows from all texels, and planning and rendering agree about it."""

import itertools

import numpy as np
import pytest

from dataset_builder.assets.asset import (
    Material,
    Texture,
    coverage_range,
    disperses,
    is_pane,
    is_solid,
    range_of,
    sends,
    texel_ends,
)
from dataset_builder.planning.effects.features import _CALLS
from dataset_builder.rendering.surface.texels import needs


def textured(**maps: list[float]) -> Texture:
    made = {name: np.array([values], dtype=np.float32) for name, values in maps.items()}
    return Texture(base_color=np.ones((1, 2, 3), dtype=np.float32), **made)


def material(metallic: float = 1.0, roughness: float = 1.0, **more: object) -> Material:
    return Material(name="glass", base_color=(1, 1, 1), metallic=metallic, roughness=roughness,
                    **more)  # type: ignore[arg-type]


def test_ranges_are_over_the_texels() -> None:
    made = material(0.5, 0.8, texture=textured(metallic=[0.25, 1.0], roughness=[0.5, 0.1]))
    assert range_of(made, "metallic") == pytest.approx((0.125, 0.5))
    assert range_of(made, "roughness") == pytest.approx((0.08, 0.4))
    assert range_of(material(0.5), "metallic") == (0.5, 0.5)
    assert range_of(material(roughness=0.3), "roughness") == (0.3, 0.3)


def test_what_is_not_a_number_counts_as_one() -> None:
    made = material(texture=textured(metallic=[np.nan, np.nan], roughness=[0.5, np.nan]))
    assert range_of(made, "metallic") == (1, 1) and range_of(made, "roughness") == (0.5, 1)


@pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
def test_ends_of_a_map_are_those_of_its_texels_by_channel(dtype: type) -> None:
    texels = np.random.default_rng(4).uniform(-0.2, 1.2, (7, 5, 3)).astype(dtype)
    low, high = texel_ends(Texture(base_color=texels), "base_color")
    assert np.array_equal(low, np.clip(texels, 0, 1).min(axis=(0, 1)))
    assert np.array_equal(high, np.clip(texels, 0, 1).max(axis=(0, 1)))
    assert all(float(end) == 1 for end in texel_ends(None, "alpha"))


def test_a_texel_that_means_the_cutoff_is_there_in_half_precision() -> None:
    """0.2 is rounded down; rendering allows for it, and so does planning."""
    texture = Texture(base_color=np.ones((1, 1, 3), np.float16), alpha=np.full((1, 1), 0.2, np.float16))
    assert coverage_range(material(alpha_cutoff=0.2, texture=texture)) == (1, 1)
    assert coverage_range(material(alpha_cutoff=0.201, texture=texture)) == (0, 0)


def test_the_least_metallic_texel_decides() -> None:
    for texels, glass in (([1.0, 1.0], False), ([1.0, 0.5], True), ([0.0, 0.0], True)):
        made = material(transmission=1.0, abbe=30.0, texture=textured(metallic=texels))
        assert (is_solid(made), is_pane(made), disperses(made)) == (glass, False, glass)
    assert not is_solid(material(transmission=1.0)) and not is_solid(material(metallic=0.0))
    assert is_pane(material(0.5, transmission=1.0, thin=True))


def test_planning_and_rendering_agree_on_all_that_a_material_calls_for() -> None:
    """Everything that rendering needs is planned."""
    textures = (None, textured(), *(textured(metallic=texels) for texels in ([1.0, 1.0], [1.0, 0.2])),
                *(textured(**{name: texels}) for name in ("transmission", "alpha", "coat")
                  for texels in ([0.0, 0.0], [0.0, 1.0], [1.0, 1.0])))
    for metallic, transmission, thin, abbe, coat, alpha, texture in itertools.product(
            (0.0, 1.0), (0.0, 1.0), (False, True), (0.0, 30.0), (0.0, 0.5), (0.5, 1.0), textures):
        made = material(metallic, transmission=transmission, thin=thin, abbe=abbe, coat=coat, alpha=alpha,
                        texture=texture)
        planned = {feature for feature, (calls, _) in _CALLS.items() if calls(made)}
        assert needs([made]) <= planned
        assert planned - needs([made]) <= {"specular"}


def test_a_map_of_nothing_switches_its_factor_off() -> None:
    nothing = {name: textured(**{name: [0.0, 0.0]}) for name in ("transmission", "coat", "alpha")}
    glass = material(0.0, transmission=1.0, texture=nothing["transmission"])
    assert not is_solid(glass) and is_solid(material(0.0, transmission=1.0, texture=nothing["coat"]))
    assert range_of(material(coat=0.5, texture=nothing["coat"]), "coat") == (0, 0)
    assert coverage_range(material(texture=nothing["alpha"])) == (0, 0)
    tinted = Texture(base_color=np.ones((1, 1, 3), np.float32), emission=np.array([[[1.0, 0.0, 0.5]]], np.float32))
    assert range_of(material(emission=(2.0, 3.0, 1.0), texture=tinted), "emission") == (0, 2)
    assert sends(material(emission=(2.0, 3.0, 1.0), texture=tinted))
    assert not sends(material(emission=(0.0, 3.0, 0.0), texture=tinted))
