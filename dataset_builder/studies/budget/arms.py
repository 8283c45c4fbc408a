"""What is compared: mixes of samples that examples are rendered with, and ways to spend one budget on them."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from dataset_builder.errors import UserError
from dataset_builder.layers import HALF
from dataset_builder.spec.dataset import DatasetSpec

PASSES = {"target": "I_t", "rough": "S'", "source": "I_s"}
"""Passes with noise that LighTNet learns from, and what they make."""
DENOISED = ("i_t", "s_prime", "i_s")
"""Layers of these passes."""
PLAIN = "plain"
LOSSES = {PLAIN: "plain loss", "weighted": "weighted loss", "two_samples": "loss of two samples"}
"""What losses make of the truth's noise, by values of `objective.noise`, and what they are called."""


@dataclass(frozen=True, kw_only=True)
class Mix:
    """How examples are rendered: samples per pixel by pass, and whether their layers are denoised."""

    target: int
    rough: int
    source: int
    denoised: bool = False

    @property
    def spp(self) -> int:
        """What every pass has at least."""
        return min(self.target, self.rough, self.source)

    @property
    def raised(self) -> str:
        """The pass that has more than the others; empty where all have the same."""
        return next((name for name in PASSES if getattr(self, name) > self.spp), "")

    @property
    def name(self) -> str:
        """Of folders: `16`, `16-denoised`, `16-target-64`."""
        more = f"-{self.raised}-{getattr(self, self.raised)}" if self.raised else ""
        return f"{self.spp}{more}{'-denoised' if self.denoised else ''}"

    @property
    def title(self) -> str:
        """For people: `16 spp (I_t 64) raw`."""
        more = f" ({PASSES[self.raised]} {getattr(self, self.raised)})" if self.raised else ""
        return f"{self.spp} spp{more} {'denoised' if self.denoised else 'raw'}"

    def settings(self, dataset: DatasetSpec) -> tuple[str, ...]:
        """What it changes in a dataset's spec; goals of accuracy give way to fixed spp. Layers that losses which expect
        noise need are added: no pass takes longer for them. A denoised I_t has no halves."""
        spp = dataset.render.spp.model_dump(mode="json") | {name: getattr(self, name) for name in PASSES}
        layers = [name for name in DENOISED if name in dataset.layers] if self.denoised else []
        halves = () if self.denoised else (f"layers.{HALF}={dataset.layers['i_t']}",)
        return (*halves, "storage.standard_errors=true", "render.accuracy={}", f"render.spp={json.dumps(spp)}",
                f"render.denoise={json.dumps({'layers': layers, 'examples': 1})}")


def even(spp: int, *, denoised: bool = False) -> Mix:
    """The same spp in every pass."""
    return Mix(target=spp, rough=spp, source=spp, denoised=denoised)


def mixes_of(grid: Sequence[int], base: int, *, denoise: bool) -> tuple[Mix, ...]:
    """Every spp of a rising grid, raw and, if asked, denoised; then `base` with one pass raised to the next spp."""
    above = grid[grid.index(base) + 1]
    return (*map(even, grid), *(even(spp, denoised=True) for spp in grid if denoise),
            *(Mix(target=above if name == "target" else base, rough=above if name == "rough" else base,
                  source=above if name == "source" else base) for name in PASSES))


@dataclass(frozen=True, kw_only=True)
class Arm:
    """One way to spend a budget."""

    mix: Mix
    budget: float
    """In units of the smallest one."""
    seconds: float
    """Render seconds that it is worth."""
    examples: int
    """As many as they buy."""
    noise: str = PLAIN
    """What its losses make of the truth's noise: a key of `LOSSES`."""

    @property
    def name(self) -> str:
        """Of folders."""
        return f"{self.mix.name}{'' if self.noise == PLAIN else f'-{self.noise}'}-x{self.budget:g}"

    @property
    def even(self) -> bool:
        """Whether nothing but spp and denoising tells it from others of its budget: no pass raised, a plain loss."""
        return not self.mix.raised and self.noise == PLAIN

    @property
    def way(self) -> str:
        """For people: how its examples are rendered, and learnt from where that is not plain."""
        return self.mix.title + ("" if self.noise == PLAIN else f", {LOSSES[self.noise]}")

    @property
    def title(self) -> str:
        """For people."""
        return f"{self.way}, {self.examples} examples"


def arms_of(costs: Mapping[Mix, float], budgets: Sequence[float], least: int,
            noisy: Collection[Mix] = ()) -> tuple[Arm, ...]:
    """Every mix at every budget, rising; at the largest alone those with a raised pass, and `noisy` mixes again with
    losses that expect noise, which change nothing about the examples.

    costs: render seconds of an example. The smallest budget buys `least` examples of the dearest raw mix that has no
    raised pass. Raises UserError where a budget buys fewer than two examples.
    """
    unit = least * max(cost for mix, cost in costs.items() if not (mix.denoised or mix.raised))
    found = tuple(Arm(mix=mix, budget=budget, seconds=budget * unit, examples=int(budget * unit / cost + 1e-9))
                  for budget in budgets for mix, cost in costs.items() if not mix.raised or budget == max(budgets))
    if poor := [arm for arm in found if arm.examples < 2]:
        raise UserError(f"expected budgets of at least two examples, got {poor[0].seconds:.0f} s, which buy "
                        f"{poor[0].examples} of {poor[0].mix.title}: ask for more with --least")
    return (*found, *(replace(arm, noise=noise) for arm in found if arm.mix in noisy and arm.budget == max(budgets)
                      for noise in LOSSES if noise != PLAIN))
