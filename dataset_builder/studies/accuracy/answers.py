"""From laws to answers: the samples that an error asked for takes, or the error that hours buy, with hours and bytes.

Samples and goals for an asked error follow from errors and counts of samples alone; times price them, and choose
between goals and one number for all. Hours are turned into an error of a coarse series, the least whose hours are
surely within those asked for: their 95% interval and all. Both choices have steps: without steps, settings would follow
every change of a time. Steps are few, and at one either answer is as good.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean, median

from dataset_builder.layers import LAYERS, sampled_as
from dataset_builder.studies.accuracy.dataset_work import DatasetWork
from dataset_builder.studies.accuracy.laws import Law, equal_error, laws, of_layer
from dataset_builder.studies.accuracy.other_examples import NoiseSpread, fixed_of, pace_of, rest_of, spread_of
from dataset_builder.studies.accuracy.rows import ADAPTIVE, DENOISED, UNIFORM, AccuracyRow, of
from dataset_builder.studies.image_errors import geometric_mean

ERROR = 0.1
"""Asked of a layer where nothing is asked."""
SERIES = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
"""What errors that hours buy are rounded to, times a power of ten: R10 of ISO 3."""
DECADES = range(-4, 0)
CLEAR = 0.8
"""Hours of goals, over those of one number of samples for all, up to which goals are advised."""
HOUR, GB = 3600.0, 1e9


@dataclass(frozen=True, kw_only=True)
class AskedAccuracy:
    """What the user wants to know."""

    errors: Mapping[str, float] = field(default_factory=dict)
    """sqrt(relMSE) by layer, for 95% of the examples; `ERROR` of the others. With hours, only their ratios count."""
    hours: float | None = None
    examples: int | None = None
    """How many; the spec's own unless given."""
    within: float = 0.1
    """Relative half-width that the 95% interval of the hours is to have at most."""
    gpu_speed: float | None = None
    """Of a GPU over one core, where the user knows it."""

    def error_of(self, layer: str) -> float:
        """What is asked of a layer."""
        return self.errors.get(layer, ERROR)


@dataclass(frozen=True, kw_only=True)
class Answer:
    """One way to get there, for the whole dataset."""

    way: str
    """A key of `QUESTIONS`."""
    errors: Mapping[str, tuple[float, float]]
    """By layer, the error of the median example, and what 95% of the examples stay below."""
    spp: Mapping[str, float]
    """By pass, mean over examples."""
    goals: Mapping[str, float]
    """By layer, for `render.accuracy`; none without goals."""
    cap: int
    """Most spp, with goals."""
    core_hours: float
    """Of one core, or one GPU, from beginning to end."""
    within: float
    """Relative half-width of their 95% interval."""
    gigabytes: float

    @property
    def longest(self) -> float:
        """Core-hours at the upper end of their interval."""
        return self.core_hours * (1 + self.within)


class Answers:
    """What the rows of a study and the work of its dataset say. clock: `cpu_seconds`, or `seconds` on a GPU."""

    def __init__(self, rows: Sequence[AccuracyRow], work: DatasetWork, clock: str, *, first: int, batches: int,
                 dtype: str, examples: int | None = None):
        self._work, self.first, self._batches, self._dtype = work, first, batches, dtype
        self._scale = (examples or work.examples) / work.examples
        self.laws = laws(rows, clock)
        self.layers = list(dict.fromkeys(law.layer for law in self.laws if law.question == UNIFORM))
        self.spread: dict[str, NoiseSpread] = {layer: spread_of(rows, self.laws, layer) for layer in self.layers}
        ratios = {layer: equal_error(tightest(rows, layer), of_one(self.laws, layer), ADAPTIVE, clock)
                  for layer in self.layers}
        self._gain = {layer: geometric_mean(one.paths for one in own) for layer, own in ratios.items()}
        self._rounds = {layer: _rounds(tightest(rows, layer), self.laws, layer, clock) for layer in self.layers}
        self._longer = {layer: _longer(self.laws, layer) for layer in self.layers}
        self._pace = {layer: pace_of(rows, self.laws, layer, clock) for layer in self.layers}
        self._fixed = {layer: fixed_of(self.laws, layer) for layer in self.layers}
        rest = rest_of(rows, clock)
        self._rest = rest if math.isfinite(rest) else work.rates["view"]

    def floor(self, layer: str, way: str = UNIFORM) -> float:
        """relMSE that samples do not remove, mean over examples."""
        return fmean(law.error.rest for law in found) if (found := of_layer(self.laws, way, layer)) else math.nan

    def uniform(self, errors: Mapping[str, float]) -> Answer | None:
        """One number of samples for every pass, so that 95% of the examples stay below the errors; None where no
        number of samples gets there."""
        left = {layer: error**2 - self.floor(layer) for layer, error in errors.items()}
        if min(left.values()) <= 0:
            return None
        wanted = {layer: max(self.spread[layer].limit / left[layer], 1.0) for layer in errors}
        return self.fixed(self._by_pass(lambda layer: self._whole(wanted[layer]), errors))

    def fixed(self, spp: Mapping[str, float]) -> Answer:
        """These samples in each pass."""
        errors = dict[str, tuple[float, float]]()
        for layer, spread in self.spread.items():
            name = sampled_as(LAYERS[layer].render_pass)
            samples, floor = spp.get(name, self._work.spp[name]), self.floor(layer)
            errors[layer] = math.sqrt(spread.median / samples + floor), math.sqrt(spread.limit / samples + floor)
        return self._priced(UNIFORM, errors, spp)

    def goals(self, errors: Mapping[str, float]) -> Answer | None:
        """A goal for every layer, at which every example ends; None where none was measured, gets there,
        or may be asked for: they are at most 1."""
        asked, spp, cap = dict[str, float](), dict[str, list[float]](), float(self.first)
        for layer, error in errors.items():
            slope = geometric_mean(law.error.slope for law in of_layer(self.laws, ADAPTIVE, layer))
            left = error**2 - self.floor(layer)
            if not (left > 0 and slope > 0 and math.isfinite(self._gain[layer])):
                return None
            asked[layer] = float(f"{math.sqrt(left / slope):.2g}")
            if asked[layer] > 1:
                return None
            needed = [max(self._gain[layer] * noise / left, self.first) for noise in self.spread[layer].values]
            spp.setdefault(sampled_as(LAYERS[layer].render_pass), []).append(fmean(needed))
            cap = max(cap, 2 * self._gain[layer] * self.spread[layer].limit / left)
        found = {layer: (error, error) for layer, error in errors.items()}
        return self._priced(ADAPTIVE, found, {name: max(means) for name, means in spp.items()}, asked, cap)

    @property
    def goals_known(self) -> bool:
        """Whether every law of goals is known: the 95% interval of its slope does not hold 0."""
        return all(law.error.slope > law.error.slope_within for law in self.laws if law.question == ADAPTIVE)

    def denoised(self, errors: Mapping[str, float]) -> Answer | None:
        """As `uniform`, with denoised layers; None where its bias is above what is asked."""
        shares = dict[str, float]()
        for layer, error in errors.items():
            found, plain = of_layer(self.laws, DENOISED, layer), of_layer(self.laws, UNIFORM, layer)
            left = error**2 - self.floor(layer, DENOISED)
            if not found or left <= 0:
                return None
            gain = geometric_mean(law.error.slope for law in found) / geometric_mean(law.error.slope for law in plain)
            shares[layer] = self._whole(max(gain * self.spread[layer].limit / left, 1.0))
        spp = self._by_pass(shares.__getitem__, errors)
        return self._priced(DENOISED, {layer: (math.nan, error) for layer, error in errors.items()}, spp)

    def of_errors(self, asked: AskedAccuracy, times: float = 1.0) -> Answer | None:
        """Goals where they are known and take clearly fewer hours than one number for all, else that. times: errors."""
        errors = {layer: times * asked.error_of(layer) for layer in self.layers}
        goals, one = self.goals(errors) if self.goals_known else None, self.uniform(errors)
        return goals if goals and not (one and goals.core_hours > CLEAR * one.core_hours) else one

    def of_hours(self, asked: AskedAccuracy, workers: int) -> tuple[Answer | None, Answer | None]:
        """The least errors that the hours surely buy, in the ratios asked for, None where they buy none below 100%; and
        the answer of the next errors down, where there is one, whose hours may be more."""
        finer = None
        for error in (digit * 10.0**decade for decade in DECADES for digit in SERIES):
            answer = self.of_errors(asked, error / max(map(asked.error_of, self.layers)))
            if answer and asked.hours and answer.longest / workers <= asked.hours:
                return answer, finer
            finer = answer
        return None, finer

    def _whole(self, spp: float) -> int:
        return math.ceil(spp / self._batches) * self._batches

    def _by_pass(self, wanted: Callable[[str], float], layers: Mapping[str, float]) -> dict[str, float]:
        spp = dict[str, float]()
        for layer in layers:
            name = sampled_as(LAYERS[layer].render_pass)
            spp[name] = max(spp.get(name, 0.0), wanted(layer))
        return spp

    def _priced(self, way: str, errors: Mapping[str, tuple[float, float]], spp: Mapping[str, float],
                goals: Mapping[str, float] | None = None, cap: float = 1.0) -> Answer:
        work, seconds, doubt = self._work, self._base(), 0.0
        paces = [pace for pace, _ in self._pace.values()]
        typical = geometric_mean(paces) if paces else work.rates["path"]
        for name in work.spp:
            layer = next((layer for layer in self.layers if LAYERS[layer].render_pass == name), None)
            samples = spp.get(sampled_as(name), work.spp[name]) * work.pixels[name]
            pace, error = self._pace[layer] if layer else (typical, typical)
            longer = self._longer[layer] if layer and way == DENOISED else 1.0
            once = self._fixed[layer] + (self._rounds[layer] if goals else 0.0) if layer else work.rates["launch"]
            seconds += longer * (samples * pace + work.runs[name] * once)
            doubt = math.hypot(doubt, longer * samples * error)
        return Answer(way=way, errors=errors, spp=spp, goals=goals or {}, cap=2 ** math.ceil(math.log2(cap)),
                      core_hours=self._scale * seconds / HOUR,
                      within=2 * math.hypot(doubt / seconds, work.error),
                      gigabytes=self._scale * work.bytes[self._dtype] / GB)

    def _base(self) -> float:
        """Core-seconds besides the passes under study."""
        work = self._work
        return work.views * self._rest + work.examples * work.rates["example"] + work.fields


def tightest(rows: Sequence[AccuracyRow], layer: str) -> list[AccuracyRow]:
    """Rows of a layer's tightest goal: looser ones end while what rounds cost besides samples still counts for much."""
    own = of(rows, ADAPTIVE, layer)
    return [row for row in own if row.value == min(other.value for other in own)]


def _rounds(rows: Sequence[AccuracyRow], found: Sequence[Law], layer: str, clock: str) -> float:
    """Seconds that the rounds of goals take besides their samples, the mean over examples: paths cost what they do
    without goals."""
    extra = [median(getattr(row, clock) - law.time.at(row.spp) for row in own)
             for law in of_layer(found, UNIFORM, layer)
             if (own := [row for row in rows if row.example == law.example])]
    return max(fmean(extra), 0.0) if extra else math.nan


def _longer(found: Sequence[Law], layer: str) -> float:
    """Time of denoised pictures over that of others with the same samples, the most that were measured of both."""
    plain = {law.example: law for law in of_layer(found, UNIFORM, layer)}
    return geometric_mean(law.time.at(spp) / plain[law.example].time.at(spp)
                          for law in of_layer(found, DENOISED, layer) if law.example in plain
                          for spp in (min(law.most, plain[law.example].most),))


def of_one(found: Sequence[Law], layer: str) -> list[Law]:
    """The laws of one layer."""
    return [law for law in found if law.layer == layer]
