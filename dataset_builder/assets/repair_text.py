"""What repair did to a mesh file, in words for the plan and the label."""

from collections.abc import Sequence

from dataset_builder.geometry.repair import PartRepair, RepairReport

NAMED = 3
"""How many parts are told of."""


def repair_text(report: RepairReport, names: Sequence[str]) -> str:
    """What was done to the whole mesh, and to the parts of a file, `names`, to which most was done."""
    whole = (f"{report.welded} vertices welded, {report.degenerate} degenerate and {report.duplicate} duplicate faces "
             f"dropped, {report.turned} faces and {report.inside_out} closed pieces turned; {report.pieces} pieces "
             f"kept apart, {report.closed} of them closed")
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
        found.append(f"{report.turned:,} faces were wound against their neighbours, and were turned")
    if report.inside_out:
        found.append(f"{report.inside_out:,} closed pieces were inside out, and were turned outwards")
    if report.one_sided:
        found.append(f"{report.one_sided:,} pieces have one side only, like a Moebius strip, and were left so: there "
                     "normals, and the noise along them, jump")
    return found


def _done(part: PartRepair) -> int:
    return part.welded + part.degenerate + part.duplicate + part.turned + part.inside_out


def _part(part: PartRepair) -> str:
    what = {"welded": part.welded, "degenerate": part.degenerate, "duplicate": part.duplicate, "turned": part.turned,
            "inside out": part.inside_out}
    return ", ".join(f"{count} {name}" for name, count in what.items() if count)
