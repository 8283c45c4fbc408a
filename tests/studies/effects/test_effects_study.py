"""The effects study: verdicts on pictures whose difference is known, and the whole of it on tiny examples."""

import csv
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.cli.main import main
from dataset_builder.label.example_plan import Decision
from dataset_builder.rendering.sampling.pixel_noise import PRIOR
from dataset_builder.studies.effects.effects_study import Compared, decisions
from dataset_builder.studies.effects.picture_differences import clear_difference, freedom, noisy_difference
from tests.small_specs import write_spec

PIXELS, BATCHES, ALLOWED, SIGMA = 4000, 4, 0.01, 0.3


def measured(stream: np.random.Generator, truth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Means around (P, 3) values and variances of them, known as moderated ones are; channels are noisy together."""
    variance, freedom = SIGMA**2 / BATCHES, BATCHES - 1 + PRIOR
    noise = np.sqrt(variance) * stream.normal(size=(len(truth), 1)) * np.ones(3)
    return truth + noise, variance * stream.chisquare(freedom, size=(len(truth), 1)) / freedom * np.ones(3)


def judged(factor: float = 1.0, missing: float = 0.0) -> list[bool]:
    """(bias, pixels) of a planned picture that is `factor` of the truth, and black in a share `missing` of pixels."""
    stream = np.random.default_rng(5)
    truth = np.full((PIXELS, 3), 2.0)
    simplified = truth * factor
    simplified[:round(missing * PIXELS)] = 0
    (planned, one), (everything, two) = measured(stream, simplified), measured(stream, truth)
    found = noisy_difference("0", "i_t", [planned], [everything], one + two, allowed=ALLOWED, batches=BATCHES)
    return [found.bias_holds, found.pixels_hold]


def test_noise_alone_passes() -> None:
    assert judged() == [True, True]


def test_a_bias_within_what_is_allowed_passes() -> None:
    assert judged(factor=1 - 0.9 * ALLOWED) == [True, True]


def test_a_bias_beyond_it_fails() -> None:
    assert not judged(factor=1 - 3 * ALLOWED)[0]


def test_an_effect_that_few_pixels_lose_fails_although_the_mean_holds() -> None:
    assert judged(missing=0.3 * ALLOWED) == [True, True]
    assert judged(missing=8 * ALLOWED) == [False, False]
    assert not judged(factor=1 + 8 * ALLOWED, missing=8 * ALLOWED)[1]


def test_the_share_that_noise_gives_is_students() -> None:
    stream = np.random.default_rng(6)
    truth = np.full((40_000, 3), 2.0)
    (one, first), (two, second) = measured(stream, truth), measured(stream, truth)
    found = noisy_difference("0", "i_t", [one], [two], first + second, allowed=0.0, batches=BATCHES)
    # Twice fifteen degrees of freedom: P(|t| > 3.3) = 0.25%
    assert freedom(BATCHES) == 30 and found.expected == pytest.approx(0.0025, abs=1e-4)
    assert found.share == pytest.approx(found.expected, rel=0.25)
    assert found.bias_holds and found.pixels_hold


def test_a_share_that_few_degrees_of_freedom_would_excuse_fails() -> None:
    """1.3% of pixels off by far: with six degrees of freedom 1.64% would be noise."""
    truth = np.zeros((PIXELS, 3))
    wrong = truth.copy()
    wrong[:round(0.013 * PIXELS)] = 1.0
    assert not noisy_difference("0", "i_t", [wrong], [truth], np.full_like(truth, 1e-4), allowed=ALLOWED,
                                batches=BATCHES).pixels_hold


@pytest.mark.parametrize("sign", [1, -1])
def test_layers_below_zero_are_judged_as_those_above(sign: int) -> None:
    stream = np.random.default_rng(8)
    truth = np.full((PIXELS, 3), 2.0)
    (planned, one), (everything, two) = measured(stream, truth * 0.9), measured(stream, truth)
    found = noisy_difference("0", "air", [sign * planned], [sign * everything], one + two, allowed=0.2, batches=BATCHES)
    assert found.bias == pytest.approx(-0.1 * sign, abs=0.01) and found.bias_se > 0
    assert found.verdict == "same" and found.share < 0.01
    clear = clear_difference("0", "air", [sign * planned] * 2, [sign * everything] * 2, allowed=0.2)
    assert clear.verdict == "same"


def test_layers_without_light_are_judged_by_their_mean() -> None:
    stream = np.random.default_rng(7)
    ours, theirs = ([0.5 + 0.1 * stream.normal(size=(PIXELS, 3)) for _ in range(4)] for _ in range(2))
    found = clear_difference("0", "d", ours, theirs, allowed=ALLOWED)
    # 0.1 sqrt(3) / 3 / 0.5 / sqrt(4000 pixels), two sides of four
    assert found.bias_se == pytest.approx(0.1 / np.sqrt(3) / 0.5 * np.sqrt(2 / 4 / PIXELS), rel=0.05)
    assert found.verdict == "same"
    assert clear_difference("0", "d", [0.9 * one for one in ours], theirs, allowed=ALLOWED).verdict == "differs"


def test_a_difference_from_nothing_fails() -> None:
    black, grey = [np.zeros((9, 3))] * 2, [np.ones((9, 3))] * 2
    assert clear_difference("0", "d", black, black, allowed=ALLOWED).verdict == "same"
    assert clear_difference("0", "d", grey, black, allowed=ALLOWED).verdict == "differs"
    assert noisy_difference("0", "s", grey, black, black[0], allowed=ALLOWED, batches=4).verdict == "differs"


def test_what_noise_hides_is_not_resolved_and_says_what_it_takes() -> None:
    """Standard errors of 2% each side: 1% + (3.3 + 1.6) 2% sqrt(2) would have been seen, and 3% take 49 times as much.
    """
    stream, truth = np.random.default_rng(9), np.full((100, 3), 2.0)
    noise = [0.4 * stream.normal(size=(100, 1)) * np.ones(3) for _ in range(2)]
    found = noisy_difference("0", "i_t", [truth + noise[0]], [truth + noise[1]], np.full_like(truth, 2 * 0.4**2),
                             allowed=ALLOWED, batches=4)
    assert found.verdict == "not resolved" and found.smallest == pytest.approx(0.01 + 4.945 * 0.02 * 2**0.5, rel=0.05)
    assert found.samples == pytest.approx((found.smallest - 0.01) ** 2 / 0.02**2)


def shared(stream: np.random.Generator, bias: float = 0.0) -> list[np.ndarray]:
    """Four pictures whose pixels are off together by 1%, which their own errors of 1% do not say."""
    return [2 * (1 + bias) + 0.02 * (stream.normal() + stream.normal(size=(PIXELS, 1))) * np.ones(3) for _ in range(4)]


def test_errors_that_pixels_share_are_found_by_repeats() -> None:
    stream, variance = np.random.default_rng(10), np.full((PIXELS, 3), 2 * 0.02**2 / 4)

    def held(together: bool) -> int:
        return sum(noisy_difference("0", "i_t", shared(stream), shared(stream), variance, allowed=0.0, batches=4,
                                    together=together).bias_holds for _ in range(40))

    assert held(True) == 40 and held(False) < 10
    missing = noisy_difference("0", "i_t", shared(stream, -0.1), shared(stream), variance, allowed=ALLOWED, batches=4,
                               together=True)
    assert missing.verdict == "differs" and missing.sigmas == pytest.approx(5.96, abs=0.3)


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small dataset's spec."""
    return write_spec(tmp_path_factory.mktemp("effects"))


def study(spec: Path, out: Path, *options: str) -> int:
    """Exit code of the study of one example."""
    return main(["study", "effects", str(spec), "--examples", "1", "--out", str(out), "--backend", "llvm", "--set",
                 "image={width: 16, height: 16}", "--set", "layers={i_t: frame, d: object, mask: object}", *options])


def table(path: Path) -> list[dict[str, str]]:
    """Rows of a CSV file."""
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_what_planning_leaves_out_is_not_missed(spec: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert study(spec, tmp_path, "--set", "render.max_depth=auto", "--set", "render.bias=0.3") == 0
    assert "No layer of any example differs by more than its stated error" in capsys.readouterr().out
    rows = table(tmp_path / "differences.csv")
    assert {row["layer"] for row in rows} == {"i_t", "d", "mask"} and {row["verdict"] for row in rows} == {"same"}
    assert (tmp_path / "figures" / "effects.png").stat().st_size > 10_000
    page = (tmp_path / "report.html").read_text()
    assert "What was decided?" in page and "data:image/png;base64," in page
    seconds = table(tmp_path / "seconds.csv")
    assert {"target", "first_hit"} <= {row["pass"] for row in seconds}
    assert all(float(row["everything"]) > 0 for row in seconds)


def test_paths_that_are_too_short_are_found_out(spec: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert study(spec, tmp_path, "--set", "render.max_depth=2", "--set", "render.bias=0.1") == 1
    said = capsys.readouterr().out
    assert "beyond the stated error: i_t" in said and "the worst mean differs by" in said and "(i_t of" in said
    verdicts = {row["layer"]: row["verdict"] for row in table(tmp_path / "differences.csv")}
    assert verdicts["i_t"] == "differs" and "differs" not in (verdicts["d"], verdicts["mask"])


def test_noise_that_hides_a_difference_is_no_pass(spec: Path, tmp_path: Path,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    assert study(spec, tmp_path, "--set", "render.bias=0.001") == 1
    said = capsys.readouterr().out
    assert "Not resolved:" in said and "times the samples (`render.spp`)" in said


def test_decisions_are_counted_by_example() -> None:
    said = [Decision(effect="caustics", choice="noisy", reason=why) for why in ("of glass", "of metal")]
    one = Compared(example="0", planned={}, everything={}, decisions=tuple(said), differences=())
    other = Compared(example="1", planned={}, everything={}, decisions=(), differences=())
    assert decisions([one, other]) == {("caustics", "noisy"): (1, "of metal")}
