"""Do radiance, reflectance and lighting agree? Statistics of cells over a whole dataset, each with bounds.

The physics: I_t = D S + spec with spec >= 0, and S' is S but for the slopes of rough facets and noise. So where a
surface is mostly diffuse, log I_t - log(D S') is a little above 0 with a small spread, and log I_t rises by 1 with log
D and by 1 with log S'. A layer under a gamma of 2.2 rises by 0.45 or 2.2; S' of another example is unrelated. Under the
source light, which is even, log I_s rises by 1 with log(D + R), and R brings as much light as D.
"""

from collections.abc import Sequence

import numpy as np

from dataset_builder.release.cells import Cells
from dataset_builder.release.dataset_check import Check, Rule

MIN_CELLS, MIN_EXAMPLES = 100, 6
"""Diffuse cells, and examples that have some, below which statistics are not judged."""
ENOUGH = 8
"""Cells of an example that has a median or a correlation of its own."""
VARIED, SHADED = 0.1, 0.2
"""Least deviation of a logarithm that a slope is taken over, and that of S' within an example for a correlation."""
ODD = (-0.6, 1.6)
"""Bounds of an example's own median of log I_t - log(D S')."""
MIXED = 0.3
"""Least D / (D + R) of cells that tell how R reflects the source light: below, mirrors and glass show what is there."""
TINY = 1e-9

DIFFUSE_SHARE = Rule(name="diffuse_share", low=0.08, why="with less, there are too few cells to judge light by",
                     statement="share of the objects' cells with D / (D + R) >= 0.7")
ENERGY = Rule(name="energy", low=-0.5, why="0 by D S <= I_t; rough facets that face a light more directly than the "
                                           "clean mesh give some lower values; a factor of pi is -1.14",
              statement="10% quantile of log I_t - log(D S') over diffuse cells")
EXCESS = Rule(name="excess", high=0.8, why="log(1 / 0.7) = 0.36 under even light, 0.2 for self-shadowing of very "
                                           "rough meshes; a factor of pi is 1.14",
              statement="median of log I_t - log(D S') over diffuse cells")
SPREAD = Rule(name="spread", high=0.75, why="0.2 for usual roughness, 0.5 for extreme roughness; 1.5 for S' of "
                                            "another example",
              statement="interquartile range of log I_t - log(D S') over diffuse cells")
ALBEDO_SLOPE = Rule(name="albedo_slope", low=0.65, high=1.35, why="1 by I_t = D S + spec; gamma gives 0.45 or 2.2",
                    statement="slope of log I_t on log D, with log S' held fixed")
LIGHT_SLOPE = Rule(name="light_slope", low=0.65, high=1.35, why="1 by I_t = D S + spec; gamma gives 0.45 or 2.2",
                   statement="slope of log I_t on log S', with log D held fixed")
SHADING = Rule(name="shading", low=0.5, why="S' shades as S does; that of another object is almost unrelated",
               statement="median over examples of the correlation of log I_t - log D with log S'")
ODD_EXAMPLES = Rule(name="odd_examples", high=0.06, why="sound examples rarely leave these bounds",
                    statement=f"share of examples with a median of log I_t - log(D S') outside {ODD[0]} to {ODD[1]}")
SOURCE_SLOPE = Rule(name="source_slope", low=0.65, high=1.45, why="1 under even light, more where bright objects "
                                                                  "light themselves; gamma gives 0.45 or 2.2",
                    statement="slope of log I_s on log(D + R) over diffuse cells")
SOURCE_SPREAD = Rule(name="source_spread", high=1.2, why="one source light for all examples; twice the spread of a "
                                                         "sound dataset",
                     statement="80% range of examples' medians of log I_s - log(D + R)")
SPECULAR_WEIGHT = Rule(name="specular_weight", low=0.42, high=2.3, why="1 where light comes evenly from everywhere",
                       statement="light in I_s by R over light in I_s by D")
RULES = (DIFFUSE_SHARE, ENERGY, EXCESS, SPREAD, ALBEDO_SLOPE, LIGHT_SLOPE, SHADING, ODD_EXAMPLES, SOURCE_SLOPE,
         SOURCE_SPREAD, SPECULAR_WEIGHT)


def light_checks(found: Sequence[Cells]) -> list[Check]:
    """Every rule of light over the cells of a dataset's examples."""
    total = sum(len(cells) for cells in found)
    diffuse = [cells for one in found if len(cells := one.diffuse)]
    share = DIFFUSE_SHARE.judge(sum(map(len, diffuse)) / total) if total else DIFFUSE_SHARE.pass_over("no cells")
    return [share, *_target(diffuse), *_source(diffuse, [cells for cells in found if cells.clear and len(cells)])]


def _target(diffuse: Sequence[Cells]) -> list[Check]:
    rules = (ENERGY, EXCESS, SPREAD, ALBEDO_SLOPE, LIGHT_SLOPE, SHADING, ODD_EXAMPLES)
    if missing := _too_little(diffuse):
        return [rule.pass_over(missing) for rule in rules]
    ratio = np.concatenate([log_ratio(cells) for cells in diffuse])
    tenth, quarter, median, three_quarters = np.quantile(ratio, (0.1, 0.25, 0.5, 0.75))
    return [ENERGY.judge(tenth), EXCESS.judge(median), SPREAD.judge(three_quarters - quarter), *_slopes(diffuse),
            _shading(diffuse), _odd(diffuse)]


def log_ratio(cells: Cells) -> np.ndarray:
    """(C,) log I_t - log(D S'), channels together."""
    return _log(cells.i_t.sum(axis=1)) - _log(cells.d_s.sum(axis=1))


def _slopes(diffuse: Sequence[Cells]) -> list[Check]:
    log_d, log_s = ([_log(getattr(cells, name)).ravel() for cells in diffuse] for name in ("d", "s_prime"))
    slopes = _regress([_log(cells.i_t).ravel() for cells in diffuse], log_d, log_s)
    checks = []
    for rule, logs, slope in ((ALBEDO_SLOPE, log_d, slopes[0]), (LIGHT_SLOPE, log_s, slopes[1])):
        spread = float(np.std(np.concatenate(logs)))
        checks.append(rule.judge(slope) if spread >= VARIED else rule.pass_over(f"deviation {spread:.2f}, too uniform"))
    return checks


def _shading(diffuse: Sequence[Cells]) -> Check:
    found = []
    for cells in diffuse:
        shade = _log(cells.s_prime.sum(axis=1))
        if len(cells) >= ENOUGH and shade.std() >= SHADED:
            apparent = _log((cells.i_t / np.maximum(cells.d, TINY)).sum(axis=1))
            found.append(float(np.corrcoef(shade, apparent)[0, 1]) if apparent.std() else 0.0)
    return SHADING.judge(float(np.median(found))) if found else SHADING.pass_over("S' is constant on every object")


def _odd(diffuse: Sequence[Cells]) -> Check:
    medians = {cells.key: float(np.median(log_ratio(cells))) for cells in diffuse if len(cells) >= ENOUGH}
    odd = {key: median for key, median in medians.items() if not ODD[0] <= median <= ODD[1]}
    listed = ", ".join(f"{key} ({median:+.2f})" for key, median in odd.items())
    return ODD_EXAMPLES.judge(len(odd) / len(medians), listed) if medians else ODD_EXAMPLES.pass_over("few cells each")


def _source(diffuse: Sequence[Cells], clear: Sequence[Cells]) -> list[Check]:
    rules, evenly = (SOURCE_SLOPE, SOURCE_SPREAD, SPECULAR_WEIGHT), [cells for cells in diffuse if cells.clear]
    if missing := _too_little(evenly):
        return [rule.pass_over(missing) for rule in rules]
    logs = [_log(cells.d + cells.r).ravel() for cells in evenly]
    slope, = _regress([_log(cells.i_s).ravel() for cells in evenly], logs)
    even = float(np.std(np.concatenate(logs))) < VARIED
    return [SOURCE_SLOPE.pass_over("albedo is too uniform") if even else SOURCE_SLOPE.judge(slope), _levels(evenly),
            _specular(clear)]


def _levels(evenly: Sequence[Cells]) -> Check:
    levels = [float(np.median(_log(cells.i_s.sum(axis=1)) - _log((cells.d + cells.r).sum(axis=1)))) for cells in evenly
              if len(cells) >= ENOUGH]
    low, high = np.quantile(levels, (0.1, 0.9)) if levels else (0.0, 0.0)
    return SOURCE_SPREAD.judge(high - low) if levels else SOURCE_SPREAD.pass_over("few cells each")


def _specular(clear: Sequence[Cells]) -> Check:
    """I_s / (D + R) = a p + b (1 - p) with p = D / (D + R): least absolute differences, since highlights are rare."""
    share = np.concatenate([cells.diffuseness for cells in clear])
    level = np.concatenate([cells.i_s.sum(axis=1) / np.maximum((cells.d + cells.r).sum(axis=1), TINY)
                            for cells in clear])
    kept = share >= MIXED
    if kept.sum() < MIN_CELLS or share[kept].std() < VARIED:
        return SPECULAR_WEIGHT.pass_over("too few materials between diffuse and specular")
    by_d, by_r = _least_absolute(np.stack([share, 1 - share], axis=1)[kept], level[kept])
    return SPECULAR_WEIGHT.judge(by_r / by_d if by_d > 0 else float("inf"))


def _regress(values: Sequence[np.ndarray], *explained_by: Sequence[np.ndarray]) -> np.ndarray:
    """Slopes of pooled values on pooled regressors; an example counts by the root of its number of values."""
    weight = np.concatenate([np.full(len(one), len(one) ** -0.25) for one in values])
    matrix = np.stack([np.ones(len(weight)), *(np.concatenate(one) for one in explained_by)], axis=1)
    return np.linalg.lstsq(matrix * weight[:, None], np.concatenate(values) * weight, rcond=None)[0][1:]


def _least_absolute(matrix: np.ndarray, values: np.ndarray, rounds: int = 20) -> np.ndarray:
    """Coefficients of least absolute differences, by reweighted least squares."""
    weight = np.ones(len(values))
    for _ in range(rounds):
        found = np.linalg.lstsq(matrix * weight[:, None], values * weight, rcond=None)[0]
        weight = np.maximum(np.abs(values - matrix @ found), 1e-3) ** -0.5
    return found


def _too_little(cells: Sequence[Cells]) -> str:
    count = sum(map(len, cells))
    enough = count >= MIN_CELLS and len(cells) >= MIN_EXAMPLES
    return "" if enough else (f"{count} diffuse cells in {len(cells)} examples, needs {MIN_CELLS} in "
                              f"{MIN_EXAMPLES}")


def _log(values: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(values, TINY))
