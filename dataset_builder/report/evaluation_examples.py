"""Best, median and worst examples of an evaluation, by the first method's PSNR, with the pictures of every method."""

from collections.abc import Sequence

from dataset_builder.lightnet.data.lighting_dataset import LightingDataset
from dataset_builder.lightnet.data.loader import whole_images
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.lightnet.results.clustered_means import chosen
from dataset_builder.lightnet.results.evaluate import Contender, ScoreRow
from dataset_builder.lightnet.results.pictures import cropped, found, given
from dataset_builder.report.estimates import rounded
from dataset_builder.report.example_sheet import SheetRow


def example_rows(rows: Sequence[ScoreRow], contenders: Sequence[Contender], dataset: LightingDataset) -> list[SheetRow]:
    """A row of pictures for each chosen example and contender; the predictions are made again."""
    measured = {(row.method, row.key): row for row in rows}
    sheet = []
    for place, row in chosen(rows, contenders[0].name).items():
        for batch in whole_images(dataset, [dataset.keys.index(row.key)]):
            for one in contenders:
                moved = batch.to(one.device)
                shown = {**given(moved), **found(moved, one.find(moved))}
                sheet.append(SheetRow(lines=_lines(place, measured[one.name, row.key]),
                                      panels=cropped(shown, moved.inputs.inside[0])))
    return sheet


def _lines(place: str, row: ScoreRow) -> list[str]:
    figures = [f"{metric.symbol} {rounded(getattr(row.metrics, metric.name), metric.name)} {metric.unit}"
               for metric in METRICS]
    return [f"{place}: {row.key}", row.method, row.object, row.room, *figures]
