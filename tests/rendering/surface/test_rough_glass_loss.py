"""What a sphere of rough white glass loses between its facets is what docs/materials.md says."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from dataset_builder.studies.stress.case import Size
from dataset_builder.studies.stress.material_cases import GLASS, furnace

PAGE = Path(__file__).parents[3] / "docs/materials.md"
TOLD = re.compile(r"(\d+)% at\s+roughness 0\.2, (\d+)% at 0\.5\s+and (\d+)% at 1 ")


def left(roughness: float) -> float:
    """Mean of I over the sphere's disc, under a sky of 1 that fills the rest of the frame."""
    size = Size(name="small", side=32, spp=32, replicas=2, faces=0, long=0)
    picture = furnace(replace(GLASS, roughness=roughness), size)
    covered = float(picture.mask.mean())
    return (float(picture.i.mean()) - (1 - covered)) / covered


@pytest.mark.parametrize(("place", "roughness"), [(1, 0.2), (2, 0.5), (3, 1.0)])
def test_the_page_says_what_rough_glass_keeps(place, roughness):
    found = TOLD.search(PAGE.read_text(encoding="utf-8"))
    assert found is not None
    measured = 100 * left(roughness)
    print(f"roughness {roughness}: {measured:.1f}% is kept, the page says {found[place]}%")
    assert abs(measured - float(found[place])) < 1.5
