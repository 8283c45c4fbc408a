"""Faults that files of 3D-FRONT and 3D-FUTURE are known to have, to plant into the house of `front3d_files`."""

import copy
from collections.abc import Callable
from typing import Any

from tests.front3d_files import House, still
from tests.front3d_pieces import jid_of, lshape_files

Plant = Callable[[House], Any]
GONE = "models that are not there, left out"
NOT_PUBLISHED = "pieces of furniture that were not published, left out"
PLACES = "placements that are no numbers, left out"


def _obj(model: str, change: Callable[[bytes], bytes]) -> Plant:
    def plant(house: House) -> None:
        name = f"models/{jid_of(model)}/raw_model.obj"
        house.files[name] = change(house.files[name])
    return plant


def _mtl(model: str, more: bytes) -> Plant:
    def plant(house: House) -> None:
        house.files[f"models/{jid_of(model)}/model.mtl"] += more
    return plant


def _drop(*names: str) -> Plant:
    def plant(house: House) -> None:
        for name in names:
            del house.files[name]
    return plant


def _child(model: str, **values: Any) -> Plant:
    return lambda house: house.child(model).update(values)


def _entry(model: str, **values: Any) -> Plant:
    return lambda house: house.entry(model).update(values)


def _mesh(kind: str, **values: Any) -> Plant:
    return lambda house: house.mesh(kind).update(values)


def _wood(**values: Any) -> Plant:
    return lambda house: house.material("wood").update(values)


def _undescribed(house: House) -> None:
    for key in ("size", "bbox", "category", "title", "sourceCategoryId", "valid"):
        del house.entry("stool")[key]


def _again(key: str, number: int = 0, **values: Any) -> Plant:
    return lambda house: house.document[key].append({**copy.deepcopy(house.document[key][number]), **values})


def _placed(room: str, ref: str, **values: Any) -> Plant:
    return lambda house: house.room(room)["children"].append({"ref": ref, **still(), "instanceid": "more/1", **values})


def _centimetres(house: House, **sizes: Any) -> None:
    house.files.update({f"models/{jid_of('lshape')}/{name}": content for name, content in lshape_files(100).items()})
    for key in ("size", "bbox"):
        del house.entry("lshape")[key]
    house.entry("lshape").update(sizes)


def _texts(house: House) -> None:
    mesh = house.mesh("Floor")
    mesh["uv"] = [f"{value:.5f}" for value in mesh["uv"]]


def _nothing_in(key: str, value: Any) -> Plant:
    def plant(house: House) -> None:
        house.mesh("Floor")[key][0] = value
    return plant


def _without_floor(house: House) -> None:
    gone = {mesh["uid"] for mesh in house.document["mesh"] if mesh["type"] == "Floor"}
    room = house.room("Kitchen-44")
    room["children"] = [child for child in room["children"] if child["ref"] not in gone]


def _into(house: House) -> None:
    house.child("stool")["pos"] = [7.0, 0.0, 1.3]
    house.room("Bedroom-31")["children"].append(house.room("Kitchen-44")["children"].pop())


def _homeless(house: House) -> None:
    uid = house.mesh("Cornice")["uid"]
    for room in house.document["scene"]["room"]:
        room["children"] = [child for child in room["children"] if child["ref"] != uid]


NIGHTSTAND = f"models/{jid_of('nightstand')}"
WOOD = "textures/bbbb-wood/texture.png"
FAULTS: dict[str, tuple[Plant, str, int]] = {
    "model not on disk": (_drop(f"{NIGHTSTAND}/raw_model.obj"), GONE, -1),
    "valid is false": (_entry("stool", valid=False), NOT_PUBLISHED, -1),
    "no valid at all": (_undescribed, NOT_PUBLISHED, -1),
    "furniture listed again": (_again("furniture", 1), "uids that are there twice, the first counts", 0),
    "ref to nothing": (_placed("Kitchen-44", "8319/model"), "references to nothing, left out", 0),
    "door to nothing": (lambda house: house.document["extension"]["door"][0]["ref"].append("8319/model"),
                        "doors that refer to nothing", 0),
    "scale near 0": (_child("nightstand", scale=[1, 1e-6, 1]), "scales near 0 or without end, left out", -1),
    "scale of 6": (_child("stool", scale=[6, 1, 1]), "pieces of furniture with scales above 5, as they are", 0),
    "scale of 40": (_child("stool", scale=[40, 40, 40]), "pieces of furniture longer than 10 m, left out", -1),
    "no rotation": (_child("stool", rot=[0, 0, 0, 0]), "rotations that are none, left out", -1),
    "rotation without end": (_child("stool", rot=[0, 1e300, 0, 1e300]), "rotations that are none, left out", -1),
    "rotation of length 2": (_child("stool", rot=[0, 0, 0, 2]), "rotations of another length than 1, made 1", 0),
    "place is NaN": (_child("stool", pos=[float("nan"), 0, 0]), PLACES, -1),
    "place is null": (_child("stool", pos=None), PLACES, -1),
    "place is text": (_child("stool", pos=["4.4", "0", "5.0"]), "numbers written as text, read", 0),
    "place is far": (_child("stool", pos=[1e5, 0, 0]), "places further than 10 km, left out", -1),
    "no place": (lambda house: house.child("stool").pop("pos"),
                 "placements without all of pos, rot and scale, taken for none", 0),
    "numbers as text": (_texts, "numbers written as text, read", 0),
    "no uv": (_mesh("Floor", uv=[]), "meshes without texture coordinates, which take one texel", 0),
    "null in uv": (_nothing_in("uv", None), "texture coordinates that are no numbers, taken for 0", 0),
    "NaN in xyz": (_nothing_in("xyz", float("nan")), "faces with corners that are no numbers, left out", 0),
    "face beyond": (_nothing_in("faces", 999), "faces with corners that are not there, left out", 0),
    "face twice": (lambda house: house.mesh("Floor")["faces"].extend([0, 1, 2]), "meshes that were mended", 0),
    "half a face": (lambda house: house.mesh("Floor")["faces"].append(0), "lists that end within a row, cut", 0),
    "empty mesh": (_mesh("Baseboard", faces=[]), "meshes without faces, left out", -1),
    "mesh of NaN": (_mesh("Baseboard", xyz=[float("nan")] * 18), "meshes without faces, left out", -1),
    "mesh without area": (_mesh("Baseboard", xyz=[1.0] * 18), "meshes without area, left out", -1),
    "mesh without material": (lambda house: house.mesh("Floor").pop("material"),
                              "meshes without a material, taken for grey", 0),
    "material not there": (_mesh("Floor", material="zzz"), "meshes without a material, taken for grey", 0),
    "no type": (_mesh("Cornice", type="  "), "meshes without a type", 0),
    "texture not there": (_drop(WOOD), "textures that are not there, plain colours instead", 0),
    "texture broken": (lambda house: house.files.update({WOOD: b"no image"}),
                       "textures that cannot be read, plain colours instead", 0),
    "material listed again": (_again("material"), "uids that are there twice, the first counts", 0),
    "no colour": (_wood(color=None), "materials without a colour, taken for white", 0),
    "colour beyond 255": (_wood(color=[300, 0, 0, 255]), "colours beyond 0 to 255, clipped", 0),
    "broken UVTransform": (_wood(UVTransform=[1, 2]), "texture transforms that are none, left out", 0),
    "emission": (_mtl("stool", b"Ke 1 1 1\n"), "models that glow or are glass by their materials, which is reset", 0),
    "glass": (_mtl("stool", b"illum 7\n"), "models that glow or are glass by their materials, which is reset", 0),
    "unreadable obj": (_obj("stool", lambda _: b"v 0 0\nf 1 2 3\n"), "models that cannot be read, left out", -1),
    "empty obj": (_obj("stool", lambda _: b""), "models that cannot be read, left out", -1),
    "obj of NaN": (_obj("stool", lambda text: text.replace(b"v ", b"v nan ", 1)),
                   "models that cannot be read, left out", -1),
    "obj names a library elsewhere": (_obj("stool", lambda text: b"mtllib ../../x.mtl\n" + text),
                                      "models that cannot be read, left out", -1),
    "model's texture not there": (_drop(f"models/{jid_of('bed')}/texture.png"),
                                  "models whose textures cannot be read, in plain colours", 0),
    "centimetres by size": (lambda house: _centimetres(house, size=[0.6, 0.4, 0.5]),
                            "models in centimetres, brought to metres", 0),
    "centimetres by bbox": (lambda house: _centimetres(house, bbox=[[0.6, 0.5, 0.4]]),
                            "models in centimetres, brought to metres", 0),
    "centimetres by own size": (_centimetres, "models without a declared size in centimetres, by their own size", 0),
    "declared in centimetres": (lambda house: _centimetres(house, size=[60, 40, 50]),
                                "models in centimetres, brought to metres", 0),
    "neither unit": (_entry("lshape", size=[3, 4, 1], bbox=[3, 4, 1]),
                     "models whose size is not the declared one, the nearer of metres and centimetres taken", 0),
    "size and bbox differ": (_entry("lshape", bbox=[0.006, 0.004, 0.005]),
                             "models whose size is not the declared one, the nearer of metres and centimetres taken",
                             0),
    "off centre": (_obj("lshape", lambda text: text.replace(b"v -0.3", b"v -0.5")),
                   "models off their origin, which is the middle of their base, placed as they are", 0),
    "in each other": (_into, "pieces of furniture that stand in each other, as they are", 0),
    "in a wall": (_child("wardrobe", pos=[7.4, 0, 3.95]), "pieces of furniture that stand in walls, as they are", 0),
    "placed twice": (lambda house: house.room("Kitchen-44")["children"].append(dict(house.child("stool"))),
                     "things placed twice, the second left out", 0),
    "no floor": (_without_floor, "rooms without a floor", 0),
    "mesh of no room": (_homeless, "meshes of no room, in place", 0),
    "jid leads elsewhere": (_entry("stool", jid="../textures/bbbb-wood"), "jids that name no folder, left out", -1),
    "jid is local": (_entry("stool", jid="local"), "pieces of furniture without a model, left out", -1),
    "no uid": (_entry("stool", uid=None), "entries without a uid, left out", -1),
    "entry is no object": (lambda house: house.document["furniture"].append(7), "entries that are no objects, left out",
                           0),
    "list is none": (lambda house: house.document["extension"].update(door={}), "lists that are none, left out", 0),
    "no list of models": (lambda house: setattr(house, "models", {}),
                          "lists of models that are not there; categories are the scene's own", 0),
}
"""By name: what plants it, the kind of fault that is told, and how many things are there more than without."""
