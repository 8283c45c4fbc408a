"""How often each pass ran: counted in the record that the build wrote of every example, not taken from the plan."""

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from dataset_builder.planning.catalogue import ExampleRef, examples
from dataset_builder.shards.folder import SECONDS
from dataset_builder.studies.comma_separated import read_csv
from dataset_builder.studies.noise.noise_study import NoiseStudy

NO_PASSES = ("plan", "encode", "denoise")
"""Stages that trace nothing."""
MEANINGS = {
    "first_hit": "light-free layers", "source": "I_s", "target": "I_t", "rough": "S'",
    "first_hit_rough": "where the rough mesh is seen", "lighting": "spherical harmonics of the target light",
    "instance": "instances",
}


@dataclass(frozen=True, kw_only=True)
class PassCount:
    """How often one pass ran."""

    name: str
    ran: int
    """Times that the pass was rendered for `examples` examples."""
    examples: int
    seconds: float
    """Of all of them together."""
    per: str
    """What it ran once for, empty where that cannot be said."""
    once: bool
    """Whether it was shared by all noise levels."""

    @property
    def meaning(self) -> str:
        """What it makes."""
        return MEANINGS.get(self.name, self.name)


def count_passes(study: NoiseStudy) -> list[PassCount]:
    """Every pass that ran for the dataset, the shared ones first. Examples that a gate rejected are counted, too: their
    passes ran."""
    refs = {ref.key: ref for ref in examples(study.loaded.dataset)}
    ran, seconds = Counter[str](), defaultdict[str, float](float)
    made = dict[str, ExampleRef]()
    for line in read_csv(study.dataset / SECONDS):
        key, step = line["key"], line["step"]
        if key in refs and step not in NO_PASSES:
            made[key] = refs[key]
            ran[step] += 1
            seconds[step] += float(line["seconds"])
    found = [_count(name, ran[name], seconds[name], list(made.values())) for name in ran]
    return sorted(found, key=lambda one: (not one.once, one.ran))


def pass_lines(counts: Sequence[PassCount]) -> list[str]:
    """One line for each pass, and what sharing saved."""
    lines = [f"{one.name} ({one.meaning}): ran {one.ran} times for {one.examples} examples{one.per and ', '}{one.per}, "
             f"{one.seconds:.1f} s" for one in counts]
    return [*lines, saving(counts)]


def saving(counts: Sequence[PassCount]) -> str:
    """What rendering every example apart would have taken, by what its passes took here."""
    shared = sum(one.seconds for one in counts)
    apart = sum(one.seconds * one.examples / one.ran for one in counts)
    repeated = [one.name for one in counts if not one.once]
    return (f"{', '.join(repeated) or 'no pass'} ran again for each noise level; all passes took {shared:.1f} s, and "
            f"would have taken {apart:.1f} s if each example had been rendered separately")


def _count(name: str, ran: int, seconds: float, made: Sequence[ExampleRef]) -> PassCount:
    views, lights = len({ref.view for ref in made}), len({(ref.view, ref.light) for ref in made})
    # Where counts are equal, as with one light per view, the first that fits is told
    meanings = ((views, "once per view"), (lights, "once per view and light"), (len(made), "once per example"))
    per = next((text for count, text in meanings if count == ran), "")
    return PassCount(name=name, ran=ran, examples=len(made), seconds=seconds, per=per, once=ran <= lights)
