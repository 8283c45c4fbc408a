"""A dataset that a gallery has something to tell of: seconds, rejected examples, and the pixels of one of them."""

from pathlib import Path

import numpy as np

from dataset_builder.engine.rejected_pixels import keep_pixels
from dataset_builder.shards.manifest import Rejected
from dataset_builder.shards.publish import publish_dataset
from tests.shards.tiny_dataset import HEIGHT, WIDTH, build, make_layers

KEYS = [f"{index:08d}" for index in range(4)]
LOST = "00000009"


def build_shown(folder: Path) -> Path:
    """Build it: four examples of 8x6 pixels, the last one alone in its split."""
    manifest = build(folder)
    lost = Rejected(key=LOST, view="train/000004", gate="finite", reason="3 <b>NaN</b> in i_t")
    far = Rejected(key="../../x", view="test/000004", gate="range", reason="2 values of d above 1")
    publish_dataset(folder, manifest.model_copy(update={
        "rejected": (far, lost), "totals": manifest.totals.model_copy(update={"rejected": 2})}))
    nothing = np.full((HEIGHT, WIDTH, 3), np.nan, np.float32)
    keep_pixels(folder, LOST, {**make_layers(lost.view), "i_t": nothing})
    (folder / "seconds.csv").write_text("key,step,seconds\n00000000,plan,0.5\n00000000,target,1.25\n00000003,plan,2\n")
    return folder
