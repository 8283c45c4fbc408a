"""Objects that are fields already: what a dataset may ask of them, and what is refused, all of it at once."""

from pathlib import Path

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.own_fields import TO_HAVE
from tests.small_fields import write_ball

BALL = "file: ball.npz\nlicence: CC0-1.0\ncategory: ball\n"
DATASET = """\
name: tiny
{more}
splits:
  - name: train
    objects: {{count: 1, from: [objects/{target}.yaml]}}
    scenes: {{count: 1, from: [scenes/den.yaml]}}
"""
HAVE = "layers: {i_s: object, mask_field: object, s_prime: object, mask_rough: object, normal_rough: object}"


@pytest.fixture
def spec(in_folder, tmp_path: Path):
    """Writes a dataset whose target or furniture is the field of a ball."""
    write_ball(tmp_path / "objects" / "ball.npz")

    def write(more: str = HAVE, target: str = "ball", ball: str = BALL, furniture: str = "stool") -> Path:
        scene = f"room: ../rooms/den.yaml\nfurniture:\n  - {{object: ../objects/{furniture}.yaml, place: near}}\n"
        return in_folder(**{"tiny.yaml": DATASET.format(more=more, target=target), "objects/ball.yaml": ball,
                            "scenes/den.yaml": scene})

    return write


def problems(path: Path) -> list[str]:
    with pytest.raises(SpecError) as error:
        load_dataset(path)
    return [str(problem) for problem in error.value.problems]


def test_what_needs_no_clean_mesh_can_be_had(spec) -> None:
    loaded = load_dataset(spec())
    assert loaded.meshes["objects/ball.yaml"].path.name == "ball.npz"
    assert set(loaded.dataset.layers) <= set(TO_HAVE)
    assert load_dataset(spec("layers: {s_prime: object, s_prime_se: object}\nstorage: {standard_errors: true}"))


def test_layers_of_the_clean_mesh_are_one_problem(spec) -> None:
    only, = problems(spec(""))
    said, have = only.split(" (there are ")
    assert said == ("tiny.yaml:1: layers: expected layers that need no clean mesh, since objects/ball.yaml (split "
                    "train) is a field, got d, r, i_t, mask")
    assert {"i_s", "mask_field", "s_prime", "mask_rough", "normal_rough"} <= set(have.split(", "))
    only, = problems(spec("layers: {i_s_clean: object, i_t_se: object, depth: object, i_s: object}"))
    assert "got i_s_clean, i_t_se, depth (" in only


def test_what_is_seen_alone_has_no_frame_and_is_not_denoised(spec) -> None:
    found = problems(spec("layers: {i_s: frame, s_prime: object}\nrender: {denoise: {layers: [i_s]}}"))
    assert found == [
        "tiny.yaml:2: layers.i_s: expected object, since objects/ball.yaml (split train) is a field, seen alone, got "
        "frame", "tiny.yaml:3: render.denoise.layers: expected no i_s, which is the image of objects/ball.yaml (split "
        "train)"]
    assert load_dataset(spec(HAVE + "\nrender: {denoise: {layers: [s_prime]}}"))


def test_its_rough_mesh_is_one(spec) -> None:
    only, = problems(spec(HAVE + "\nrough: {sigma: [0.001, 0.004]}"))
    assert "rough: expected one level, since the rough mesh of objects/ball.yaml is its own, got 2 levels" in only
    assert load_dataset(spec(HAVE + "\nrough: {sigma: 0.004}"))


@pytest.mark.parametrize(("line", "key"), [("scale: 0.5", "scale"), ("up: z", "up")])
def test_it_has_metres_and_stands(spec, line: str, key: str) -> None:
    only, = problems(spec(ball=f"{BALL}{line}\n"))
    assert only == (f"objects/ball.yaml:4: {key}: expected no `{key}` beside a field, which has metres and stands "
                    "already (scale, turn and place it where it is made: `dataset-builder import capture`)")


def test_materials_may_change_on_furniture_alone(spec) -> None:
    dimmed = BALL + "materials: {capture: {base_color: [0.5, 0.5, 0.5]}}\n"
    only, = problems(spec(ball=dimmed))
    assert only == ("tiny.yaml:5: splits[0].objects.from[0]: expected no `materials` of objects/ball.yaml as a target, "
                    "since its image would not follow, got capture (as furniture it may have them)")
    assert load_dataset(spec("", target="stool", ball=dimmed, furniture="ball"))


def test_furniture_asks_for_nothing(spec) -> None:
    assert "i_t" in load_dataset(spec("", target="stool", furniture="ball")).dataset.layers


def test_a_field_of_a_field_is_refused(spec) -> None:
    path = spec()
    path.write_text(path.read_text() + "    source: {kind: field, views: 20}\n")
    only, = problems(path)
    assert only.startswith("tiny.yaml:7: splits[0].source.kind: expected kind mesh, since every object of split train")
