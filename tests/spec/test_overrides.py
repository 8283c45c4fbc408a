"""Overrides edit the dataset file before it is validated."""

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.spec.load import load_dataset, parse_override


def test_values_are_yaml() -> None:
    override = parse_override("camera.fov={uniform: [30, 1e2]}")
    assert (override.keys, override.value) == (("camera", "fov"), {"uniform": (30, 100.0)})
    assert parse_override("title=a=b").value == "a=b"


def test_paths(tiny) -> None:
    path = tiny()
    spec = load_dataset(path, ["render.spp=8", "splits.0.views=2", "splits.test.views=3", "rough.sigma=[0, 0.02]",
                               "seed=9", "splits.test.objects.from.0=objects/chair.yaml"]).dataset
    assert spec.render.spp.model_dump() == dict.fromkeys(("first_hit", "source", "target", "rough"), 8)
    assert [split.views for split in spec.splits] == [2, 3]
    assert spec.rough.levels == (0.0, 0.02)
    assert spec.seed == 9
    assert spec.splits[1].objects.source == ("objects/chair.yaml",)


def test_the_last_override_wins_and_the_file_stays(tiny) -> None:
    path = tiny()
    before = path.read_bytes()
    assert load_dataset(path, ["seed=1", "seed=2"]).dataset.seed == 2
    assert path.read_bytes() == before
    assert load_dataset(path).dataset.seed == 3


def test_an_override_equals_the_same_text_in_the_file(tiny) -> None:
    overridden = load_dataset(tiny(), ["rough.sigma={uniform: [0, 1e-2]}"])
    written = tiny(**{"tiny.yaml": tiny().read_text().replace("{sigma: 0.01}", "{sigma: {uniform: [0, 1e-2]}}")})
    assert overridden.spec_digest == load_dataset(written).spec_digest


@pytest.mark.parametrize(("text", "message"), [
    ("render.sp=4", "--set render.sp=4: render.sp: expected no such key, got 4 (nearest known key: spp)"),
    ("rendr.spp=4", "--set rendr.spp=4: rendr: expected no such key, got {spp: 4} (nearest known key: render)"),
    ("splits.trian.views=2", "--set splits.trian.views=2: splits: expected an index below 2 or a name, got 'trian' "
     "(nearest known name: train)"),
    ("splits.2.views=2", "--set splits.2.views=2: splits: expected an index below 2 or a name, got '2' "
     "(known names: train, test)"),
    ("seed.x=1", "--set seed.x=1: seed: expected a mapping or a list to look up 'x' in, got 3"),
    ("seed=x", "--set seed=x: seed: expected a whole number, got 'x'"),
    ("seed=", "--set seed=: seed: expected a whole number, got nothing"),
    ("rough={sigma: -1}", "--set rough={sigma: -1}: rough.sigma: expected >= 0, got -1"),
    ("seed", "--set seed: expected KEY=VALUE, such as seed=7, got 'seed'"),
    ("=1", "--set =1: expected KEY=VALUE"),
    ("a..b=1", "--set a..b=1: expected KEY=VALUE"),
    ("seed=[1", "--set seed=[1: expected valid YAML"),
])
def test_bad_overrides(tiny, text: str, message: str) -> None:
    with pytest.raises(SpecError) as caught:
        load_dataset(tiny(), [text])
    assert len(caught.value.problems) == 1
    assert message in str(caught.value)


def test_bad_overrides_are_told_with_everything_else(tiny) -> None:
    with pytest.raises(SpecError) as caught:
        load_dataset(tiny(**{"rooms/den.yaml": "width: 0\n"}), ["nonsense", "seed.x=1", "title=5"])
    assert len(caught.value.problems) == 4
