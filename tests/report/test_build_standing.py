"""What is known of a build while it runs, from events that are made up."""

import pytest

from dataset_builder.builder import Event
from dataset_builder.engine.unit import Outcome
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef
from dataset_builder.planning.unit_cost import example_seconds
from dataset_builder.report.build_standing import CURVE, REASONS, VALUES, BuildStanding, RunningMedian
from dataset_builder.report.rate_curve import HEIGHT, WIDTH, rate_curve
from dataset_builder.shards.manifest import Rejected
from dataset_builder.spec.load import load_dataset
from tests.small_specs import write_spec


def outcome(index: int, split: str = "train", *, kept: bool = False, gate: str = "", view: int = 0,
            noise: dict[str, tuple[str, float]] | None = None) -> Outcome:
    ref = ExampleRef(index=index, view=ViewRef(number=view, camera=0, pair=PairRef(split=split, object=0, scene=0)),
                     light=0, level=0)
    rejected = Rejected(key=ref.key, view=ref.view.name, gate=gate, reason=f"got {index}") if gate else None
    return Outcome(ref=ref, digest="0", kept=kept, rejected=rejected, seconds={} if kept else {"target": 1.0},
                   noise=noise or {})


def standing(wanted: int) -> BuildStanding:
    found = BuildStanding(start=0.0)
    found.add(Event(wanted=wanted), 0.0)
    return found


def test_what_was_there_already_is_done_and_tells_no_rate() -> None:
    found = standing(100)
    found.add(Event(outcomes=tuple(outcome(index, kept=True) for index in range(90))), 0.1)
    assert (found.done, found.kept) == (90, 90) and found.rate(0.1) is None and found.left(0.1) is None
    for step in range(1, 5):
        found.add(Event(outcomes=(outcome(90 + step),)), 10.0 * step)
    assert found.rate(40.0) == pytest.approx(0.1) and found.left(40.0) == pytest.approx(60.0)
    assert found.curve == [(0.0, 0), (10.0, 1), (20.0, 2), (30.0, 3), (40.0, 4)]


def test_a_merge_has_a_rate_though_it_renders_nothing() -> None:
    found = standing(6)
    shard: object = "only whether there is one is asked"
    for step in range(1, 4):
        found.add(Event(shard=shard, outcomes=(outcome(step, kept=True),)), 2.0 * step)  # type: ignore[arg-type]
    assert found.rate(6.0) == pytest.approx(0.5) and found.left(6.0) == pytest.approx(6.0) and found.kept == 0


def test_fields_do_not_count_as_time_of_examples() -> None:
    found = standing(4)
    found.add(Event(denoised=()), 1000.0)
    found.add(Event(outcomes=(outcome(0),)), 1010.0)
    assert found.left(1010.0) == pytest.approx(30.0)


def test_a_split_that_costs_more_takes_more_of_the_time(tmp_path_factory: pytest.TempPathFactory) -> None:
    """After the cheap split was done in 2 s an example, the other's is expected in proportion to its planned cost."""
    path = write_spec(tmp_path_factory.mktemp("spec"))
    path.write_text(path.read_text().replace("name: test", "name: test\n    camera: {coverage: [0.8, 0.9]}"))
    spec = load_dataset(path, ["render.spp=4096"]).dataset
    ratio = example_seconds(spec, "test") / example_seconds(spec, "train")
    assert ratio > 1.2
    found = BuildStanding(spec, start=0.0)
    found.add(Event(wanted=20, splits={"train": 10, "test": 10}), 0.0)
    for step in range(1, 11):
        found.add(Event(outcomes=(outcome(step),)), 2.0 * step)
    assert found.left(20.0) == pytest.approx(10 * 2.0 * ratio)


def test_refusals_are_grouped_with_the_first_reasons_of_different_views() -> None:
    found = standing(1000)
    for index in range(600):
        found.add(Event(outcomes=(outcome(index, gate="coverage" if index % 3 else "field", view=index // 4),)), index)
    assert {gate: refused.count for gate, refused in found.refused.items()} == {"field": 200, "coverage": 400}
    assert found.rejected == 600
    assert [item.key for item in found.refused["coverage"].first] == ["00000001", "00000004", "00000008"]
    assert len(found.refused["field"].first) == REASONS


def test_noise_is_a_median_and_goals_are_shares() -> None:
    found = standing(10)
    for index, error in enumerate((0.01, 0.03, 0.5, float("nan"))):
        noise = {"i_t": ("error", error), "s": ("cap", 0.2), "d": ("spp", 0.0)}
        found.add(Event(outcomes=(outcome(index, noise=noise),)), index)
    assert found.noise["i_t"].median == 0.03 and found.noise["s"].median == 0.2
    assert found.goals == {"error": 0.5, "cap": 0.5}


def test_a_million_values_take_no_more_room_and_keep_their_median() -> None:
    spread = RunningMedian()
    for number in range(50_001):
        spread.add(number / 50_000)
    assert len(spread._values) <= VALUES and spread.count == 50_001
    assert spread.median == pytest.approx(0.5, abs=0.001)


def test_the_curve_stays_short_and_ends_now() -> None:
    found = standing(5000)
    for step in range(1, 3001):
        found.add(Event(outcomes=(outcome(step),)), 0.5 * step)
    assert len(found.curve) <= CURVE + 1 and found.curve[-1] == (1500.0, 3000)
    curve = rate_curve(found.curve)
    assert curve["top"] == "120/min" and curve["end"] == "25 min 00 s"
    corners = [tuple(map(float, corner.split(","))) for corner in curve["outline"].split()]
    assert corners[0] == (0, HEIGHT) and corners[-1] == (WIDTH, HEIGHT)
    assert all(y == pytest.approx(0.0, abs=0.1) for _, y in corners[1:-1])


def test_a_curve_of_next_to_nothing_is_none() -> None:
    assert rate_curve([(0.0, 0)]) == rate_curve([(0.0, 0), (1.0, 2)]) == {}
