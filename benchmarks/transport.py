"""Error x time of joined paths against camera paths, pass by pass; whether they agree; whether their errors are honest.

    python -m benchmarks.transport                                         v, t and p of passes of three specs
    python -m benchmarks.transport --spec FILE --examples 3t 3r --spp 64   of others
    python -m benchmarks.transport --reference 64 --keep FOLDER            relMSE against camera paths, too
    python -m benchmarks.transport --bias 32 --keep FOLDER                 means of many runs of both
    python -m benchmarks.transport --coverage 16                           how often 95% intervals hold

A pass is named by the index of an example and a letter: t, the image under the target light; r, the shading of the
rough mesh; s, the image under the source light; each on the pixels that its plan traces. Both kinds of paths run in
turn.

v: mean over pixels of se^2 / (x^2 + (0.1 m)^2), m the mean, new over old; t: CPU seconds, light paths and tables
included; p = v t, the time to equal error. e is the same by true relMSE, by means and by medians of runs. Exit code 1
where the geometric mean of p, as the plans choose paths, is above 0.42 or a pass is above 1; where a mean is off by
0.1% or 3.5 standard errors; where intervals hold less than 92% or more than 98%.
"""

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks import _common as common
from benchmarks.transports.bias import bias, print_bias, print_lean
from benchmarks.transports.interval_coverage import coverage, holds
from benchmarks.transports.lit_pass import LitPass, OpenPass, passes_of
from benchmarks.transports.race import HEAD, line, race, summary
from benchmarks.transports.runs import TRUTH_SPP, Runs, extend, truth

BOUND, WORST = 0.42, 1.0
SPECS = common.MINI.parent
PASSES = {
    "3df-lighting-mini.yaml": ("22t", "22r", "6t", "72t", "36t", "36r", "12t", "78r"),
    "3df-lighting-128.yaml": ("5r", "11t", "17r"),
    "3df-lighting-effects.yaml": ("0t", "5t", "5r", "6t", "7t"),
}
"""Lamps of every kind, alone and in pairs; glass, fog, coat, sheen, panes and what glows."""


def cases(given: argparse.Namespace) -> Iterator[tuple[LitPass, OpenPass]]:
    """Every pass, one open at a time; light paths do not go through fog, so such passes are told and left out."""
    chosen = {given.spec: given.examples} if given.spec else {SPECS / name: found for name, found in PASSES.items()}
    for spec, names in chosen.items():
        for case in passes_of(spec, names, given.set):
            with case.opened() as opened:
                if opened.scene.fog and given.transport == "joined":
                    print(f"{case.name:26} {case.lamps:20} {case.planned:6} fog: camera paths alone")
                else:
                    yield case, opened


def run_races(given: argparse.Namespace) -> int:
    """The table of v, t and p; exit code."""
    print(HEAD)
    found = []
    for case, opened in cases(given):
        known = truth(case, given.reference, given.keep, opened) if given.reference else None
        reference = known.reference(~opened.object if given.background else None) if known else None
        for spp in given.spp:
            found.append(race(case, opened, given.transport, spp, given.repeats, reference))
            print(line(found[-1]), flush=True)
        if known and reference:
            print(f"{'':26} relMSE of the reference {reference.own_error():.1e}, {known.number} x {TRUTH_SPP} spp")
    if not found:
        return 0
    mean, worst = summary(found)
    print(f"bounds on p as planned: geometric mean {BOUND}, worst {WORST}")
    return 0 if mean <= BOUND and worst <= WORST else 1


def run_bias(given: argparse.Namespace) -> int:
    """Differences of means; exit code."""
    found = []
    for case, opened in cases(given):
        old = truth(case, given.reference or given.bias, given.keep, opened)
        for spp in given.spp:
            new = Runs(pixels=old.pixels, inside=old.inside)
            for _ in extend(new, opened, given.transport, spp, given.bias, seed=1):
                pass
            found.append(bias(f"{case.name}, {spp} spp", case.lamps, old, new, spp))
            print_bias(found[-1])
    if found:
        print_lean(found)
    return int(any(entry.wrong for entry in found))


def run_coverage(given: argparse.Namespace) -> int:
    """Shares of intervals that hold; exit code."""
    good = True
    for case, opened in cases(given):
        for spp in given.spp:
            shares = coverage(opened, tuple(dict.fromkeys(("camera", given.transport))), spp, given.coverage)
            good = good and holds(shares)
            print(f"{case.name:26} {case.lamps:20} {spp:4} spp: 95% intervals hold in "
                  + ", ".join(f"{100 * share:.1f}% ({side})" for side, share in shares.items()), flush=True)
    return 0 if good else 1


def arguments() -> argparse.Namespace:
    """What the command line says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--spec", type=Path, help="a dataset instead of the embedded ones")
    parser.add_argument("--examples", nargs="+", default=["0t"], help="its passes, such as 0t 3r (default 0t)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the specs")
    parser.add_argument("--spp", type=int, nargs="+", default=[36, 256], help="samples per pixel (default 36 256)")
    parser.add_argument("--repeats", type=int, default=4, help="runs of each side for the table (default 4)")
    parser.add_argument("--reference", type=int, default=0, metavar="RUNS",
                        help=f"runs of camera paths at {TRUTH_SPP} spp that the truth is the mean of")
    parser.add_argument("--background", action="store_true", help="relMSE where the object is not seen: what glass and "
                        "mirrors throw about them, and not what is seen in them, which stays hard")
    mode = parser.add_mutually_exclusive_group()
    mode.add_argument("--bias", type=int, metavar="RUNS", help="compare means of so many runs")
    mode.add_argument("--coverage", type=int, metavar="RUNS", help="see how often the intervals of so many runs hold")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep runs of camera paths here, for the next time")
    parser.add_argument("--transport", choices=("camera", "joined"), default="joined",
                        help="what is held against camera paths; these themselves show the noise of all figures")
    parser.add_argument("--threads", type=int, default=0, help="0 is all cores (default)")
    return parser.parse_args()


def main() -> int:
    """Print what was asked for."""
    given = arguments()
    common.start(given.threads)
    run = run_bias if given.bias else run_coverage if given.coverage else run_races
    with tempfile.TemporaryDirectory() as folder:
        given.keep = given.keep or Path(folder)
        return run(given)


if __name__ == "__main__":
    sys.exit(main())
