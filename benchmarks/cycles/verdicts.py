"""What the comparison found, as rows, as time to equal error, and on paper."""

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from _equal_error import common_error, time_to
from cycles.contenders import LAYERS

SIDES = ("ours", "Cycles")
BEST = "best of all"
"""Mode of a verdict that lets both sides choose their fastest mode, at the error of the denoised one."""

DENOISED = "denoised"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One layer at one setting: mean error and least seconds of its repetitions. shared: seconds that all layers of
    the tuple have in common."""

    example: int
    layer: str
    system: str
    mode: str
    knob: float
    spp: float
    seconds: float
    update: float
    shared: float
    error: float


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Seconds to the same error. layer `tuple`: all of them and what they share; with_update: Cycles', scene updates
    included."""

    example: int
    mode: str
    layer: str
    error: float
    ours: float
    cycles: float
    with_update: float


def verdicts(rows: Sequence[Row]) -> list[Verdict]:
    """For every example and mode, and the best of all modes: layer by layer, and the tuple at these errors."""
    found = []
    for example in dict.fromkeys(row.example for row in rows):
        of_example = [row for row in rows if row.example == example]
        for mode in (*dict.fromkeys(row.mode for row in of_example), BEST):
            times = [_verdict(of_example, mode, layer) for layer in LAYERS]
            found += [*times, _tuple_verdict(of_example, times)]
    return found


def _verdict(rows: Sequence[Row], mode: str, layer: str) -> Verdict:
    """Time of one layer at an error that both sides reach."""
    here = [row for row in rows if row.layer == layer]
    level = common_error(*([row.error for row in here if (row.system, row.mode) == (side, _level_mode(mode))]
                           for side in SIDES))
    ours, cycles = (_fastest([row for row in here if row.system == side and mode in (row.mode, BEST)], level)
                    for side in SIDES)
    update = float(np.median([row.update for row in here if row.system == "Cycles"]))
    return Verdict(example=rows[0].example, mode=mode, layer=layer, error=level, ours=ours, cycles=cycles,
                   with_update=cycles + update)


def _level_mode(mode: str) -> str:
    return DENOISED if mode == BEST else mode


def _fastest(rows: Sequence[Row], level: float) -> float:
    """Least seconds to an error over the modes among the rows."""
    modes = {mode: [row for row in rows if row.mode == mode] for mode in dict.fromkeys(row.mode for row in rows)}
    return min(time_to(level, [row.seconds for row in of_mode], [row.error for row in of_mode],
                       floor=DENOISED in mode) for mode, of_mode in modes.items())


def _tuple_verdict(rows: Sequence[Row], times: Sequence[Verdict]) -> Verdict:
    """The sum over layers, and what they share."""
    mode = times[0].mode
    ours, cycles = (min(row.shared for row in rows if row.system == side and mode in (row.mode, BEST))
                    for side in SIDES)
    return Verdict(example=rows[0].example, mode=mode, layer="tuple", error=float("nan"),
                   ours=ours + sum(time.ours for time in times), cycles=cycles + sum(time.cycles for time in times),
                   with_update=cycles + sum(time.with_update for time in times))


# Output


def print_rows(rows: Sequence[Row]) -> None:
    """What was measured."""
    print(f"\n{'ex':>3} {'layer':8} {'mode':19} {'system':7} {'knob':>6} {'spp':>6} {'seconds':>8} {'relMSE':>9}")
    for row in sorted(rows, key=lambda row: (row.example, row.layer, row.mode, row.system)):
        print(f"{row.example:3} {row.layer:8} {row.mode:19} {row.system:7} {row.knob:6g} {row.spp:6.0f} "
              f"{row.seconds:8.3f} {row.error:9.2e}")


def print_verdicts(found: Sequence[Verdict]) -> None:
    """Time to equal error."""
    print(f"\n{'ex':>3} {'mode':19} {'layer':8} {'relMSE':>9} {'ours s':>8} {'Cycles s':>9} {'ratio':>6} "
          "ratio with scene updates")
    for entry in found:
        print(f"{entry.example:3} {entry.mode:19} {entry.layer:8} {entry.error:9.2e} {entry.ours:8.3f} "
              f"{entry.cycles:9.3f} {entry.cycles / entry.ours:5.1f}x {entry.with_update / entry.ours:5.1f}x")


def summary(found: Sequence[Verdict]) -> dict[tuple[str, str], float]:
    """(mode, layer) -> geometric mean over examples of Cycles' time over ours."""
    ratios: dict[tuple[str, str], list[float]] = {}
    for entry in found:
        ratios.setdefault((entry.mode, entry.layer), []).append(entry.cycles / entry.ours)
    return {key: float(np.prod(of_key) ** (1 / len(of_key))) for key, of_key in ratios.items()}


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """One line per row."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=[field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def draw(path: Path, rows: Sequence[Row]) -> None:
    """Error against seconds, one panel per layer, all examples in one; a line per system, mode and example."""
    from matplotlib.figure import Figure

    colours = dict(zip(dict.fromkeys(row.mode for row in rows), ("C0", "C1", "C2", "C3"), strict=False))
    figure = Figure(figsize=(12, 4), layout="constrained")
    for axes, layer in zip(figure.subplots(1, len(LAYERS)), LAYERS, strict=True):
        lines: dict[tuple[str, str, int], list[Row]] = {}
        for row in rows:
            if row.layer == layer:
                lines.setdefault((row.system, row.mode, row.example), []).append(row)
        for (system, mode, example), points in lines.items():
            label = f"{system}, {mode}" if example == rows[0].example else None
            axes.loglog([row.seconds for row in points], [row.error for row in points], color=colours[mode],
                        linestyle="-" if system == "ours" else "--", marker="o", markersize=3, label=label)
        axes.set(title=layer, xlabel="seconds", ylabel="relMSE")
        axes.xaxis.set_minor_formatter("")
    figure.axes[0].legend(fontsize="x-small", handlelength=4)
    figure.savefig(path, dpi=150)
