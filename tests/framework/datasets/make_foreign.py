# SPDX-License-Identifier: Apache-2.0
"""make_foreign.py KIND FOLDER: datasets as h5py and tarfile make them. Exits with 77 when a library
is absent."""
import io
import json
import os
import sys
import tarfile

try:
    import h5py
    import numpy as np
except ImportError:
    sys.exit(77)

HEIGHT, WIDTH = 30, 44


def pictures(seed):
    rng = np.random.default_rng(seed)
    ids = np.zeros((HEIGHT, WIDTH), np.int64)
    ids[4:14, 6:20] = 1
    ids[10:25, 25:40] = 7
    colors = rng.integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    depth = np.full((HEIGHT, WIDTH), 1e10, np.float32)
    depth[ids == 1] = 1.5
    depth[ids == 7] = np.float32(2.25)
    normals = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    normals[ids > 0] = [0.5, 0.5, 1.0]
    return colors, depth, normals, ids


def write_blenderproc(path, how, seed):
    """The names and types of BlenderProc's writer."""
    colors, depth, normals, ids = pictures(seed)
    attributes = [
        {"idx": 0, "category_id": 0, "name": "background"},
        {"idx": 1, "category_id": 3, "name": "Suzanne"},
        {"idx": 7, "category_id": 5, "name": "Cube", "category_name": "box"},
    ]
    state = [{"cam2world_matrix": [[1, 0, 0, 0.5], [0, 0, -1, -3], [0, 1, 0, 1], [0, 0, 0, 1]],
              "cam_K": [[50.0, 0, 21.5], [0, 52.0, 14.5], [0, 0, 1]]}]
    with h5py.File(path, "w", libver=how.get("libver", "earliest")) as file:
        packed = how["packed"]
        file.create_dataset("colors", data=colors, **packed)
        file.create_dataset("depth", data=depth.astype(how.get("depth", "<f4")), **packed)
        file.create_dataset("normals", data=normals, **packed)
        file.create_dataset("instance_segmaps", data=ids.astype(how["ids"]), **packed)
        text = json.dumps(attributes)
        if how.get("variable"):
            file.create_dataset("instance_attribute_maps", data=text)
        else:
            file.create_dataset("instance_attribute_maps", data=np.bytes_(text))
        file.create_dataset("cam_states", data=np.bytes_(json.dumps(state)))
        file.create_dataset("blender_proc_version", data=np.bytes_("2.6.1"))
        file.create_group("more").create_dataset("inner", data=[1, 2, 3])


def make_hdf5(folder):
    gzip = {"compression": "gzip"}
    ways = [
        {"packed": gzip, "ids": "<u1"},
        {"packed": {}, "ids": "<i8"},
        {"packed": {"chunks": True, "shuffle": True, "fletcher32": True, **gzip}, "ids": "<u2"},
        {"packed": {"compression": "lzf", "shuffle": True}, "ids": ">i4", "depth": ">f4"},
        {"packed": gzip, "ids": "<u2", "libver": "latest"},
        {"packed": {}, "ids": "<i2", "libver": "latest", "depth": "<f8"},
        {"packed": {"chunks": True}, "ids": "<u4", "variable": True},
    ]
    for how in ways:
        if "chunks" in how["packed"] or how["packed"]:
            how["packed"] = dict(how["packed"])
    # Numbers without zeros in front: 2 comes before 10.
    for place, how in enumerate(ways):
        write_blenderproc(os.path.join(folder, f"{place * 5}.hdf5"), how, place)


def make_pieces(folder):
    """Chunks that do not divide the extents, each a known number."""
    values = np.arange(7 * 11 * 3, dtype="<u2").reshape(7, 11, 3)
    with h5py.File(os.path.join(folder, "pieces.h5"), "w") as file:
        file.create_dataset("three", data=values, chunks=(3, 4, 2), compression="gzip")
        file.create_dataset("one", data=values.reshape(-1), chunks=(50,), shuffle=True,
                            compression="gzip")
        file.create_dataset("empty", shape=(0, 4), dtype="<f4")
        file.create_dataset("never", shape=(5, 6), dtype="<f4", chunks=(2, 2))
    with h5py.File(os.path.join(folder, "latest.h5"), "w", libver="latest") as file:
        file.create_dataset("three", data=values, chunks=(3, 4, 2), compression="gzip")
        file.create_dataset("one", data=values.reshape(-1), chunks=(50,))
        file.create_dataset("single", data=values, chunks=values.shape, compression="gzip")


def add(archive, name, data):
    info = tarfile.TarInfo(name)
    info.size = len(data)
    archive.addfile(info, io.BytesIO(data))


def npy(array):
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def make_tar(folder, packing="", ending=""):
    pictures = []
    for name in sorted(os.listdir(folder)):
        with open(os.path.join(folder, name), "rb") as file:
            pictures.append(file.read())
        os.remove(os.path.join(folder, name))
    for part, count in (("train", 3), ("val", 1)):
        for shard in range(2):
            form = tarfile.PAX_FORMAT if shard == 0 else tarfile.GNU_FORMAT
            name = os.path.join(folder, f"{part}-{shard:06d}.tar" + ending)
            with tarfile.open(name, "w" + packing, format=form) as archive:
                folder_info = tarfile.TarInfo("images")
                folder_info.type = tarfile.DIRTYPE
                archive.addfile(folder_info)
                for i in range(count):
                    # Long enough for what ustar cannot say.
                    key = "images/" + "a" * 120 + f"/{shard}_{i:04d}"
                    add(archive, key + ".IMAGE.PNG", pictures.pop())
                    add(archive, key + ".cls", b"3")
                    add(archive, key + ".txt", "ein Becher für Tee".encode())
                    add(archive, key + ".embedding.npy", npy(np.zeros(8, np.float16)))
                    boxes = {"caption": "x", "objects": [
                        {"bbox": [2.5, 3, 4, 5], "category": "mug"}, {"bbox": [0, 0, 1, 1]}]}
                    if i == 0:
                        add(archive, key + ".json", json.dumps(boxes).encode())


{"hdf5": make_hdf5, "pieces": make_pieces, "tar": make_tar,
 "packed_tar": lambda folder: make_tar(folder, ":gz", ".gz")}[sys.argv[1]](sys.argv[2])
