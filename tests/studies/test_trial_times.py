"""What a forecast of trainings says, by hand, and that a trial leaves nothing behind."""

from dataclasses import replace

import pytest

from dataset_builder.lightnet.settings import TrainingSpec
from dataset_builder.lightnet.training.fit import TrainingJob
from dataset_builder.report.step_paces import Paces
from dataset_builder.report.training_lines import forecast_line
from dataset_builder.studies import trial_times
from dataset_builder.studies.trainings import changed
from dataset_builder.studies.trial_times import Forecast, TimeLeft, TrialTimes, forecast, steps_left, trial
from tests.lightnet.synthetic import write_synthetic

SPEC = changed(TrainingSpec(), model={"width": 4, "downs": 2}, data={"crop": 32, "batch": 2, "workers": 0},
               check={"every": 50, "examples": 3}, steps=200)


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> TrainingJob:
    folder = tmp_path_factory.mktemp("trial")
    return TrainingJob(dataset=write_synthetic(folder / "data", train=2, held_out=2, size=32), out=folder / "out",
                       spec=SPEC, device="cpu")


def test_parts_add_up(job: TrainingJob) -> None:
    """200 steps of 0.1 s, 4 checks of 3 of 10 images and 10 at the end at 0.5 s, 2 s before the first."""
    times = TrialTimes(setup=2.0, step=0.1, error=0.01, image=0.5, held_out=10)
    assert times.of(job, 200) == (pytest.approx(2 + 20 + 22 * 0.5), pytest.approx(2.0))
    assert times.of(job, 100)[0] == pytest.approx(2 + 10 + 16 * 0.5)


def test_a_trial_is_real_and_leaves_nothing(job: TrainingJob) -> None:
    found = trial(job)
    assert min(found.setup, found.step, found.image) > 0 and found.error >= 0 and found.held_out == 2
    assert not job.out.exists() and steps_left(job) == 200


def test_each_kind_is_tried_once_and_what_is_done_takes_no_time(job: TrainingJob,
                                                                monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    def counted(one: TrainingJob) -> TrialTimes:
        tried.append(one.spec.model.width)
        return TrialTimes(setup=len(tried), step=1.0, error=0.3, image=0.0, held_out=0)

    monkeypatch.setattr(trial_times, "trial", counted)
    wide, seeded = (replace(job, spec=changed(SPEC, **more)) for more in ({"model": {"width": 8}}, {"seed": 7}))
    found = forecast([job, None, seeded, wide])
    assert tried == [4, 8] and found is not None
    assert found.seconds == (201, 0, 201, 201) and found.steps == 600 and found.kinds == 2
    assert found.error == pytest.approx(60 * 3**0.5)
    assert "3 trainings, 600 steps: about 10 min 03 s ± 1 min 44 s" in forecast_line(found, 3)


def test_short_trainings_are_not_tried(job: TrainingJob) -> None:
    assert forecast([replace(job, spec=changed(SPEC, steps=39)), None]) is None and forecast([]) is None
    assert "too few steps" in forecast_line(None, 1)


def test_what_is_left_follows_the_pace(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice as slow as foretold: half of the second of two trainings of 100 s is left, 100 s."""
    now = [0.0]
    monkeypatch.setattr(trial_times, "perf_counter", lambda: now[0])
    left = TimeLeft(Forecast(seconds=(100.0, 100.0), error=0.0, steps=2, kinds=1))
    now[0] = 300.0
    assert left.after(2, 0.5) == pytest.approx(100)


def test_examples_tell_of_each_other() -> None:
    """Steps a and b take 10 and 2 s; after the first example, three of each are left."""
    paces = Paces(["a", "b"])
    assert paces.after("a", 10.0, 7) == ""
    assert paces.after("b", 2.0, 6) == "; about 36 s left"
    assert paces.after("a", 20.0, 5) == "; about 36 s left"
    assert paces.after("b", 2.0, 0) == ""
