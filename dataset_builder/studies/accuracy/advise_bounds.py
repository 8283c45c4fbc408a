"""Questions 4 to 6: the smallest depth, mesh and texture whose error is hidden by noise or the allowed bias."""

from collections.abc import Sequence

from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.studies.accuracy.bounds import DEPTH, EDGE_LAYER, EDGES, TEXTURES, worst
from dataset_builder.studies.accuracy.curves import Advice, Point, curve
from dataset_builder.studies.accuracy.rows import AccuracyRow, layers_in, of

NEAR = 0.5
"""Share of a layer's noise that another error may have: both together are then an eighth more than the noise alone."""


def advise(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    """Sentences and overrides of all three questions."""
    _depth(advice, rows, spec)
    _edges(advice, rows, spec)
    _textures(advice, rows, spec)


def _depth(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    missing = worst(of(rows, DEPTH))
    if not missing:
        return
    enough = [depth for depth, bias in missing.items() if bias <= spec.render.bias]
    figures = ", ".join(f"{bias:.2%} at {depth:.0f}" for depth, bias in missing.items())
    said = (f"{min(enough):.0f} edges suffice for" if enough else "None of these depths suffices for")
    advice.sentences[DEPTH] = f"{said} a bias of {spec.render.bias:.1%}; the worst of any example and layer, with " \
                              f"two standard errors: {figures}."
    if spec.render.max_depth == "auto":
        advice.sentences[DEPTH] += " The spec leaves the depth to planning, which bounds it for every scene."
        advice.overrides.append("render.max_depth=auto")
    elif enough:
        advice.overrides.append(f"render.max_depth={min(enough):.0f}")


def _edges(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    points = curve(rows, EDGES, EDGE_LAYER)
    if not points:
        return
    bound = NEAR * advice.noise.get(EDGE_LAYER, spec.render.bias)
    # From the coarsest: the first that is good enough, and with it all finer ones
    chosen = _first_below(sorted(points, key=lambda point: -point.value), bound)
    figures = ", ".join(f"{_shown(point)} at {point.setting}" for point in points)
    advice.sentences[EDGES] = (
        f"{chosen.setting + ' its own edge length' if chosen else 'None of these edge lengths'} keeps the surface's "
        f"own error in S' below {bound:.1%}; it is {figures}.")
    if chosen:
        advice.marked[EDGES, EDGE_LAYER] = chosen
        if isinstance(spec.rough.edge_length, float | int):
            factor = float(chosen.setting.split()[0])
            advice.overrides.append(f"rough.edge_length={spec.rough.edge_length * factor:g}")


def _textures(advice: Advice, rows: Sequence[AccuracyRow], spec: DatasetSpec) -> None:
    wanted = []
    for layer in layers_in(rows, TEXTURES):
        bound = NEAR * advice.noise.get(layer, spec.render.bias)
        points = sorted(curve(rows, TEXTURES, layer), key=lambda point: point.value)
        chosen = _first_below(points, bound)
        wanted.append(chosen.value if chosen else spec.render.texture_size)
        figures = ", ".join(f"{_shown(point)} at {point.value:.0f}" for point in points)
        so_far = advice.sentences.get(TEXTURES, "")
        advice.sentences[TEXTURES] = f"{so_far} In {layer}, {wanted[-1]:.0f} texels per side keep the error below " \
                                     f"{bound:.1%}; it is {figures}.".strip()
        if chosen:
            advice.marked[TEXTURES, layer] = chosen
    if wanted:
        advice.overrides.append(f"render.texture_size={max(wanted):.0f}")


def _first_below(points: Sequence[Point], bound: float) -> Point | None:
    """The first point that is below the bound with all that follow it."""
    below = None
    for point in reversed(points):
        if point.error > bound:
            break
        below = point
    return below


def _shown(point: Point) -> str:
    return f"{'at most ' if point.at_floor else ''}{point.error:.2%}"
