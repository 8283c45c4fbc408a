"""From laws to answers: the samples that an error asked for takes, or the error that hours buy, with hours and bytes.

Settings for an asked error follow from errors and from counts of samples alone; times only price them, so that a
restless machine changes the hours and never the settings. Hours are turned into an error of a coarse series.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean

from dataset_builder.layers import LAYERS, sampled_as
from dataset_builder.studies.accuracy.dataset_work import DatasetWork
from dataset_builder.studies.accuracy.laws import Law, equal_error, laws, of_layer
from dataset_builder.studies.accuracy.other_examples import Spread, fixed_of, pace_of, rest_of, spread_of
from dataset_builder.studies.accuracy.rows import ADAPTIVE, DENOISED, UNIFORM, AccuracyRow
from dataset_builder.studies.image_errors import geometric_mean

ERROR = 0.1
"""Asked of a layer where nothing is asked."""
SERIES = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)
"""What errors that hours buy are rounded to, times a power of ten: R10 of ISO 3."""
DECADES = range(-4, 1)
HOUR, GB = 3600.0, 1e9


@dataclass(frozen=True, kw_only=True)
class Asked:
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
    paths: float
    core_hours: float
    """Of one core, or one GPU, from beginning to end."""
    within: float
    """Relative half-width of their 95% interval."""
    gigabytes: float


class Answers:
    """What the rows of a study and the work of its dataset say. clock: `cpu_seconds`, or `seconds` on a GPU."""

    def __init__(self, rows: Sequence[AccuracyRow], work: DatasetWork, clock: str, *, first: int, batches: int,
                 dtype: str, examples: int | None = None):
        self._work, self.first, self._batches, self._dtype = work, first, batches, dtype
        self._scale = (examples or work.examples) / work.examples
        self.laws = laws(rows, clock)
        self.layers = list(dict.fromkeys(law.layer for law in self.laws if law.question == UNIFORM))
        self.spread: dict[str, Spread] = {layer: spread_of(rows, self.laws, layer) for layer in self.layers}
        ratios = {layer: equal_error(rows, of_one(self.laws, layer), ADAPTIVE, clock) for layer in self.layers}
        self._gain = {layer: geometric_mean(one.paths for one in own) for layer, own in ratios.items()}
        self._slower = {layer: geometric_mean(one.seconds / one.paths for one in own) for layer, own in ratios.items()}
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
        """A goal for every layer, at which every example ends; None where no goal was measured or gets there."""
        asked, spp, cap = dict[str, float](), dict[str, list[float]](), float(self.first)
        for layer, error in errors.items():
            slope = geometric_mean(law.error.slope for law in of_layer(self.laws, ADAPTIVE, layer))
            left = error**2 - self.floor(layer)
            if not (left > 0 and slope > 0 and math.isfinite(self._gain[layer])):
                return None
            asked[layer] = float(f"{math.sqrt(left / slope):.2g}")
            needed = [max(self._gain[layer] * noise / left, self.first) for noise in self.spread[layer].values]
            spp.setdefault(sampled_as(LAYERS[layer].render_pass), []).append(fmean(needed))
            cap = max(cap, 2 * self._gain[layer] * self.spread[layer].limit / left)
        found = {layer: (error, error) for layer, error in errors.items()}
        return self._priced(ADAPTIVE, found, {name: max(means) for name, means in spp.items()}, asked, cap)

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

    def of_errors(self, asked: Asked, times: float = 1.0) -> Answer | None:
        """Goals where they take fewer samples than one number for all, else that number. times: the errors."""
        errors = {layer: times * asked.error_of(layer) for layer in self.layers}
        found = [answer for answer in (self.goals(errors), self.uniform(errors)) if answer]
        return min(found, key=lambda answer: answer.paths, default=None)

    def of_hours(self, asked: Asked, workers: int) -> Answer | None:
        """The least errors that the hours buy, in the ratios asked for; None where they buy none below 100%."""
        for error in (digit * 10.0**decade for decade in DECADES for digit in SERIES):
            answer = self.of_errors(asked, error / max(map(asked.error_of, self.layers)))
            if answer and asked.hours and answer.core_hours / workers <= asked.hours:
                return answer
        return None

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
        work, seconds, doubt, paths = self._work, self._base(), 0.0, 0.0
        paces = [pace for pace, _ in self._pace.values()]
        typical = geometric_mean(paces) if paces else work.rates["path"]
        for name in work.spp:
            layer = next((layer for layer in self.layers if LAYERS[layer].render_pass == name), None)
            samples = spp.get(sampled_as(name), work.spp[name]) * work.pixels[name]
            pace, error = self._pace[layer] if layer else (typical, typical)
            slower = self._slower[layer] if layer and goals else 1.0
            seconds += samples * pace * slower + work.runs[name] * (self._fixed[layer] if layer
                                                                    else work.rates["launch"])
            doubt, paths = math.hypot(doubt, samples * error * slower), paths + samples
        return Answer(way=way, errors=errors, spp=spp, goals=goals or {}, cap=2 ** math.ceil(math.log2(cap)),
                      paths=paths * self._scale, core_hours=self._scale * seconds / HOUR,
                      within=2 * math.hypot(doubt / seconds, work.error),
                      gigabytes=self._scale * work.bytes[self._dtype] / GB)

    def _base(self) -> float:
        """Core-seconds besides the passes under study."""
        work = self._work
        return work.views * self._rest + work.examples * work.rates["example"] + work.fields


def of_one(found: Sequence[Law], layer: str) -> list[Law]:
    """The laws of one layer."""
    return [law for law in found if law.layer == layer]
