"""What a card says of every dataset: each layer in plain words, what goes wrong with them, and how to read them."""

from collections.abc import Iterator

from dataset_builder.layers import LAYERS
from dataset_builder.shards.manifest import LayerRecord, Manifest

PLAIN = {
    "i_s": "the object as it plainly looks, evenly lit from all sides",
    "d": "the colour of its matte part, without light or shade",
    "r": "how much light it mirrors, by colour; not where its highlights are",
    "i_t": "the object under the lamps of the scene: what is to be predicted",
    "s_prime": "the light that falls on its rough mesh, as if the object were white and matte",
    "mask": "how much of each pixel the object covers",
    "s": "the light that falls on its clean mesh, as if the object were white and matte",
    "spec": "what is left of the picture without its matte part: highlights, reflections, views through glass",
    "air": "what fog in front of a surface adds, less what it hides",
    "i_t_empty": "the scene under its lamps with the object taken away",
    "i_pbr": "the whole scene under its lamps with the rough mesh in it",
    "mask_rough": "how much of each pixel the rough mesh covers; its outline is a little off the clean one's",
    "depth": "how far away the surface is, in metres straight ahead of the camera",
    "normal": "which way the surface faces, in the axes of the room",
    "normal_rough": "which way the surface of the rough mesh faces",
    "instance": "which object is in the middle of the pixel, as a number",
    "i_s_clean": "`i_s` as the clean mesh has it, where `i_s` is the image of a neural field",
    "mask_field": "how much of each pixel is covered by what `i_s` shows",
}
"""Every layer of its own in plain words; `docs/layers.md` has the same."""


def plain(layer: str) -> str:
    """A layer in plain words."""
    name, _, kind = layer.rpartition("_")
    others = {"se": f"how far off each pixel of `{name}` may well be: its standard error",
              "raw": f"`{name}` as it was before denoising",
              "half": f"`{name}` from the first half of its samples; twice `{name}` less it is the other half"}
    return PLAIN.get(layer) or others[kind]


def noise(layer: LayerRecord, manifest: Manifest) -> str:
    """What kind of noise a layer has."""
    if layer.name in {item.layer for item in manifest.denoised}:
        return "denoised"
    if LAYERS[layer.name].radiometric:
        return "grainy: light was sampled at random"
    return "none" if layer.name == "instance" else "at outlines and textures alone"


def pitfalls(manifest: Manifest) -> Iterator[str]:
    """What goes wrong with layers like those of this dataset, a sentence or two each."""
    names, half = {layer.name for layer in manifest.layers}, manifest.layers[0].dtype == "float16"
    yield ("Values are linear light: not gamma-encoded, without an upper end, and mostly dim. Tone-map them to look at "
           "them, and do not put them into 8 bits.")
    if {"s_prime", "i_t", "d"} <= names:
        yield ("`s_prime` is not `i_t / d`. It is the light on the *rough* mesh; `d` is 0 on metal, and `i_t` is `d` "
               "times the light on the clean mesh plus highlights.")
    if objects := [f"`{layer.name}`" for layer in manifest.layers if layer.extent == "object"]:
        yield (f"{', '.join(objects)} hold the object's pixels alone: 0 elsewhere is no black surface, it is nothing. "
               "Pixels on the outline mix object and background; nothing is divided by the mask.")
    if manifest.denoised:
        yield "Denoised layers are smooth and biased; the standard error of one is that of the noisy layer."
    elif names & {"i_s", "i_t", "s_prime", "s"}:
        yield "No layer is denoised: inputs and truth are grainy, and `record.layers` of every label says how much."
    yield ("Half precision: 11 bits, so about three digits, up to 65504; convert to float32 before adding up."
           if half else "Single precision: float32, seven digits.")


def recipes(manifest: Manifest) -> str:
    """Python that reads the dataset from the folder beside its own, first with this package, then without it."""
    name, layer, split = manifest.name, manifest.layers[0].name, manifest.splits[0].name
    shard = next(shard for shard in manifest.shards if shard.split == split)
    pattern = f"{name}/shards/{shard.slot[:-len('NNNNNN')]}*.tar"
    return f'''```python
from dataset_builder import open_dataset

example = open_dataset("{name}", layers=["{layer}"])["{split}", 0]
```

With nothing but Python and OpenEXR:

```python
import io
import json
import tarfile

import OpenEXR


def pixels(data):
    """(H, W, 3) of a layer with R, G, B; (H, W) of one with Y."""
    return next(iter(OpenEXR.File(io.BytesIO(data)).channels().values())).pixels


with tarfile.open("{name}/shards/{shard.name}") as tar:
    image = pixels(tar.extractfile("{shard.first_key}.{layer}.exr").read())
    label = json.load(tar.extractfile("{shard.first_key}.json"))
```

In a DataLoader of PyTorch, whole shards by worker:

```python
import glob

from torch.utils.data import DataLoader, IterableDataset, get_worker_info

shards = sorted(glob.glob("{pattern}"))


class Layers(IterableDataset):
    def __iter__(self):
        worker = get_worker_info()
        for path in shards[worker.id::worker.num_workers] if worker else shards:
            with tarfile.open(path) as tar:
                for member in tar:
                    if member.name.endswith(".{layer}.exr"):
                        yield member.name[:8], pixels(tar.extractfile(member).read())


for keys, images in DataLoader(Layers(), batch_size=4):
    print(keys, images.shape)
```

With webdataset, at most one worker per shard:

```python
import webdataset

dataset = webdataset.WebDataset(shards, shardshuffle=False)
dataset = dataset.decode(lambda key, data: pixels(data) if key.endswith(".exr") else None)
for image, label in dataset.to_tuple("{layer}.exr", "json"):
    print(image.shape, label["key"])
```

With Hugging Face datasets, layers as bytes:

```python
from datasets import load_dataset

for example in load_dataset("{name}", split="{split}", streaming=True):
    print(pixels(example["{layer}.exr"]).shape, example["json"]["key"])
```
'''
