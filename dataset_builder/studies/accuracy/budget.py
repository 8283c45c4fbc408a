"""How much a run of the study does: everything, or a quick trial."""

from dataclasses import dataclass

REFERENCE_DEPTH = 64


@dataclass(frozen=True, kw_only=True)
class Budget:
    """Settings of every question.

    uniform: spp of the uniform curve. first, goals, cap: adaptive sampling's first round, errors asked for and most
    spp. denoised_spp, denoised_goals: what is denoised of both. depths, depth_spp, replicates: path depths, and
    independent runs of each. edges: factors on the dataset's own edge length, the last of them the reference.
    textures: texels along a side. passes: spp of questions that are not about spp. codec_repeats: runs of each codec.
    counts: lengths of sums; the longest is the number of pixels of the picture that its samples come from.
    """

    reference_spp: int
    uniform: tuple[int, ...]
    first: int
    goals: tuple[float, ...]
    cap: int
    denoised_spp: tuple[int, ...]
    denoised_goals: tuple[float, ...]
    depths: tuple[int, ...]
    depth_spp: int
    replicates: int
    edges: tuple[float, ...]
    textures: tuple[int, ...]
    passes: int
    codec_repeats: int
    counts: tuple[int, ...]


FULL = Budget(
    reference_spp=4096, uniform=(4, 8, 16, 32, 64, 128, 256, 512, 1024), first=16, goals=(0.2, 0.1, 0.05, 0.025),
    cap=4096, denoised_spp=(4, 16, 64, 256), denoised_goals=(0.2, 0.1, 0.05), depths=(2, 3, 4, 6, 8, 12, 16),
    depth_spp=64, replicates=4, edges=(4.0, 2.0, 1.0, 0.5, 0.25), textures=(8, 16, 32, 64, 128, 256, 512), passes=256,
    codec_repeats=5, counts=(1_000, 10_000, 100_000, 1_000_000),
)

SMALL = Budget(
    reference_spp=1024, uniform=(4, 16, 64), first=16, goals=(0.4, 0.2), cap=256, denoised_spp=(16,),
    denoised_goals=(0.4,), depths=(2, 4, 8), depth_spp=16, replicates=2, edges=(4.0, 2.0, 1.0), textures=(8, 64),
    passes=16, codec_repeats=1, counts=(100, 1_000, 10_000),
)

BUDGETS = {"full": FULL, "small": SMALL}
