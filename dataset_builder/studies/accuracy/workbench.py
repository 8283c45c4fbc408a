"""What all questions share: the budget, the spec, the references, and rows made from rendered examples."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.planning.catalogue import ExampleRef
from dataset_builder.rendering.examples import Rendered
from dataset_builder.spec.render import RenderSpec
from dataset_builder.studies.accuracy.rows import AccuracyRow
from dataset_builder.studies.image_errors import flip, psnr, relative_mse, relative_variance
from dataset_builder.studies.renders import References, Warm, reached_by, seconds_of, timed, work_of
from dataset_builder.studies.sampled import StudySpec, reseeded

REFERENCE_DEPTH = 64


@dataclass(frozen=True, kw_only=True)
class Budget:
    """How much a run of the study does: settings of every question."""

    reference_spp: int
    uniform: tuple[int, ...]
    """spp of the uniform curve."""
    first: int
    """Adaptive sampling's first round, spp."""
    goals: tuple[float, ...]
    """Errors asked of adaptive sampling."""
    cap: int
    """Most spp of adaptive sampling."""
    denoised_spp: tuple[int, ...]
    """What is denoised of the uniform curve."""
    denoised_goals: tuple[float, ...]
    """What is denoised of adaptive sampling."""
    runs: int
    """Runs of every way to sample, each with its own samples, taken in turns."""
    others: int
    """Examples that tell how examples differ."""
    others_spp: int
    depths: tuple[int, ...]
    depth_spp: int
    replicates: int
    """Independent runs of each path depth."""
    edges: tuple[float, ...]
    """Factors on the dataset's own edge length, the last of them the reference."""
    textures: tuple[int, ...]
    """Texels along a side."""
    passes: int
    """spp of questions that are not about spp."""
    codec_repeats: int
    """Runs of each codec."""
    counts: tuple[int, ...]
    """Lengths of sums; the longest is the number of pixels of the picture that its samples come from."""


BUDGETS = {
    "full": Budget(
        reference_spp=4096, uniform=(4, 16, 64, 256, 1024), first=16, goals=(0.2, 0.1, 0.05), cap=4096,
        denoised_spp=(4, 16, 64, 256), denoised_goals=(0.2, 0.1), runs=3, others=24, others_spp=32,
        depths=(2, 3, 4, 6, 8, 12, 16), depth_spp=64, replicates=4, edges=(4.0, 2.0, 1.0, 0.5, 0.25),
        textures=(8, 16, 32, 64, 128, 256, 512), passes=256, codec_repeats=5,
        counts=(1_000, 10_000, 100_000, 1_000_000)),
    "medium": Budget(
        reference_spp=2048, uniform=(16, 64, 256), first=16, goals=(0.2, 0.1), cap=1024, denoised_spp=(16, 64),
        denoised_goals=(), runs=3, others=16, others_spp=16, depths=(2, 4, 8, 12, 16), depth_spp=32, replicates=3,
        edges=(4.0, 2.0, 1.0, 0.5), textures=(64, 128, 256), passes=64, codec_repeats=3,
        counts=(1_000, 10_000, 100_000, 1_000_000)),
    "small": Budget(
        reference_spp=1024, uniform=(4, 16, 64), first=16, goals=(0.4, 0.2), cap=256, denoised_spp=(4, 16),
        denoised_goals=(0.4,), runs=2, others=3, others_spp=16, depths=(2, 4, 8), depth_spp=16, replicates=2,
        edges=(4.0, 2.0, 1.0), textures=(8, 64), passes=16, codec_repeats=1, counts=(100, 1_000, 10_000)),
}

PLAIN = ("render.accuracy={}", "render.denoise={}", "storage.standard_errors=false")
"""Fixed spp, nothing denoised: what every setting starts from."""


def spp_override(render: RenderSpec, wanted: Mapping[str, float]) -> str:
    """The override for samples per pixel by pass, in whole batches; the spec's own of the others."""
    chosen = {name: list(render.spp.parts(name)) for name in ("first_hit", "source", "target", "rough")}
    chosen |= {name: [math.ceil(spp / render.batches) * render.batches] for name, spp in wanted.items()}
    return "render.spp={" + ", ".join(f"{name}: {parts if len(parts) > 1 else parts[0]}"
                                      for name, parts in chosen.items()) + "}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """What every question works with."""

    spec: StudySpec
    budget: Budget
    extents: Mapping[str, str]
    """The layers under study."""
    references: References
    repeats: int
    """How often what is short is timed."""
    warm: Warm = field(default_factory=Warm)

    def plan(self, ref: ExampleRef, *settings: str, layers: Mapping[str, str] | None = None) -> ExamplePlan:
        """One example under `settings`, with these layers (default: those under study) and the mask."""
        wanted = {**(self.extents if layers is None else layers), "mask": "object"}
        only = "layers={" + ", ".join(f"{name}: {extent}" for name, extent in wanted.items()) + "}"
        return self.spec.plan(ref, *PLAIN, only, *settings)

    def spp(self, spp: int) -> str:
        """The override for `spp`, or the next multiple of batches, in every pass with light; the light-free ones keep
        theirs, so that the object's pixels stay the same."""
        return spp_override(self.spec.dataset.render, dict.fromkeys(("source", "target", "rough"), spp))

    def timed(self, setting: str, plan: ExamplePlan, repeats: int | None = None) -> Rendered:
        """One example, timed with its kernels compiled before."""
        self.warm.up(setting, plan, self.spec.mesh_root)
        return timed(plan, self.spec.mesh_root, self.repeats if repeats is None else repeats)

    def converged(self, ref: ExampleRef) -> dict[str, np.ndarray]:
        """Layers of an example and their standard errors at the reference's spp and depth, from samples of their
        own."""
        plan = self.plan(ref, self.spp(self.budget.reference_spp), f"render.max_depth={REFERENCE_DEPTH}",
                         "storage.standard_errors=true")
        return self.references.get(reseeded(plan, "reference"), self.spec.mesh_root)

    def compared(self, question: str, setting: str, value: float, found: Rendered,
                 reference: Mapping[str, np.ndarray], layers: Iterable[str]) -> list[AccuracyRow]:
        """Rows of an example's layers against a reference with standard errors."""
        return [compare(question, setting, value, found, reference, layer) for layer in layers]


def compare(question: str, setting: str, value: float, found: Rendered, reference: Mapping[str, np.ndarray],
            layer: str) -> AccuracyRow:
    """One layer against a reference; without its standard error, the reference is taken to be free of noise."""
    image, truth, keep = found.layers[layer], reference[layer], kept(found, reference, layer)
    measured = relative_mse(image, truth, keep)
    noise = relative_variance(reference[f"{layer}_se"], truth, keep) if f"{layer}_se" in reference else 0.0
    return AccuracyRow(question=question, setting=setting, value=value, example=found.plan.key, layer=layer,
                       seconds=seconds_of(layer, found), cpu_seconds=seconds_of(layer, found, found.cpu_seconds),
                       relmse=max(measured - noise, 0.0), relmse_measured=measured,
                       relmse_reference=noise, floor=noise, psnr=psnr(image, truth, keep),
                       flip=flip(image, truth, keep), reached=reached_by(layer, found.record),
                       **work_of(layer, found.record))


def kept(found: Rendered, reference: Mapping[str, np.ndarray], layer: str) -> np.ndarray:
    """(H, W) pixels that count: the frame, or those that the object covers a share of in both pictures."""
    mask = found.layers["mask"][..., 0]
    if dict(found.plan.render.layers)[layer] == "frame":
        return np.ones(mask.shape, dtype=bool)
    return (mask > 0) & (reference["mask"][..., 0] > 0)
