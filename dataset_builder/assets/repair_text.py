"""What repair did to a mesh file, in words for the plan and the label."""

from collections.abc import Sequence

from dataset_builder.geometry.repair import PartRepair, RepairReport

NAMED = 3
"""How many parts are told of."""


def repair_text(report: RepairReport, names: Sequence[str]) -> str:
    """What was done to the whole mesh, and to the parts of a file, `names`, to which most was done."""
    whole = (f"{report.welded} vertices welded, {report.degenerate} degenerate and {report.duplicate} duplicate faces "
             f"dropped, {report.turned} faces and {report.inside_out} closed pieces turned; pieces kept apart: "
             f"{report.pieces}, of these closed: {report.closed}")
    if len(report.parts) < 2:
        return whole
    ranked = sorted(zip(names, report.parts, strict=True), key=lambda pair: -_done(pair[1]))
    told = [f"{name}: {_part(part)}" for name, part in ranked[:NAMED] if _done(part)]
    more = sum(_done(part) > 0 for _, part in ranked[NAMED:])
    return "; ".join([whole, *told, *([f"and {more} more parts"] if more else [])])


def repair_notes(report: RepairReport) -> list[str]:
    """What a person should look at: shapes that were not as they should be."""
    found = []
    if report.turned:
        found.append(f"faces wound against their neighbours, turned: {report.turned:,}")
    if report.inside_out:
        found.append(f"closed pieces inside out, turned outwards: {report.inside_out:,}")
    if report.one_sided:
        found.append(f"pieces with one side only, like a Moebius strip, left so: {report.one_sided:,} (normals jump "
                     "there, and noise along them)")
    return found


def _done(part: PartRepair) -> int:
    return part.welded + part.degenerate + part.duplicate + part.turned + part.inside_out


def _part(part: PartRepair) -> str:
    what = {"welded": part.welded, "degenerate": part.degenerate, "duplicate": part.duplicate, "turned": part.turned,
            "inside out": part.inside_out}
    return ", ".join(f"{count} {name}" for name, count in what.items() if count)
