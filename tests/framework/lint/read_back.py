#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""read_back.py WRITE_SAMPLE_DATASETS: reads what the writers make with the readers that people use
(numpy, OpenCV, json, tarfile, ElementTree) and compares the files with each other."""
import glob
import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
import xml.etree.ElementTree as ElementTree

import cv2
import numpy as np

try:
    import yaml
except ImportError:
    yaml = None

BOX_2D = np.dtype([("semanticId", "<u4"), ("x_min", "<i4"), ("y_min", "<i4"), ("x_max", "<i4"),
                   ("y_max", "<i4"), ("occlusionRatio", "<f4")])
BOX_3D = np.dtype([("semanticId", "<u4"), ("x_min", "<f4"), ("y_min", "<f4"), ("z_min", "<f4"),
                   ("x_max", "<f4"), ("y_max", "<f4"), ("z_max", "<f4"),
                   ("transform", "<f4", (4, 4)), ("occlusionRatio", "<f4")])
OCCLUSION = np.dtype([("instanceId", "<u4"), ("semanticId", "<u4"), ("occlusionRatio", "<f4")])
SIZES = {"cam_0": (48, 72), "cam_1": (48, 54)}


def equal(found, expected, what):
    if not np.array_equal(found, expected):
        raise AssertionError(f"{what}: found {found}, expected {expected}")


def picture(path):
    image = cv2.imread(path, cv2.IMREAD_UNCHANGED)
    assert image is not None, f"{path}: OpenCV cannot read it"
    return image


def rgba(path):
    return cv2.cvtColor(picture(path), cv2.COLOR_BGRA2RGBA)


def load_json(path, indent=None, newline=""):
    """Also checks that Python would write the same text."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    value = json.loads(text)
    equal(json.dumps(value, indent=indent) + newline, text, path)
    return value


def load_npy(path, dtype, shape=None):
    array = np.load(path)
    assert array.dtype == np.dtype(dtype), f"{path}: {array.dtype}"
    if shape is not None:
        equal(array.shape, shape, path)
    with open(path, "rb") as file:
        start = file.read(10)
    equal((10 + int.from_bytes(start[8:10], "little")) % 64, 0, f"{path}: header")
    return array


def extent(mask):
    ys, xs = np.nonzero(mask)
    return [int(xs.min()), int(ys.min()), int(xs.max()) + 1, int(ys.max()) + 1]


def mask_of_key(image, key):
    if key.startswith("("):
        color = np.array([int(c) for c in key[1:-1].split(",")])
        return (image == color).all(axis=2)
    return image == int(key)


def read_basic(folder, product, number, name, is_raw):
    def path(annotator, stem, ending):
        file = f"{stem}_{number}.{ending}"
        if name:
            return f"{folder}/{annotator}/{product}_{file}"
        return f"{folder}/{product}/{annotator}/{file}"

    h, w = SIZES[product[3:]]
    image = rgba(path("rgb", "rgb", "png"))
    equal(image.shape, (h, w, 4), "rgb")
    equal(str(image.dtype), "uint8", "rgb")
    assert (image[:, :, 3] == 255).all()
    equal(rgba(path("normals", "normals", "png")).shape, (h, w, 4), "normals")
    ray = load_npy(path("distance_to_camera", "distance_to_camera", "npy"), "<f4", (h, w))
    plane = load_npy(path("distance_to_image_plane", "distance_to_image_plane", "npy"), "<f4",
                     (h, w))
    equal(picture(path("distance_to_camera", "distance_to_camera", "png")).shape, (h, w), "gray")
    assert (ray >= plane).all() and np.isinf(ray).any() and np.isfinite(ray).any()
    load_npy(path("motion_vectors", "motion_vectors", "npy"), "<f4", (h, w, 4))

    read = picture if is_raw else rgba
    instances = read(path("instance_segmentation", "instance_segmentation", "png"))
    if is_raw:
        equal(str(instances.dtype), "uint16", "raw ids")
    mapping = load_json(path("instance_segmentation", "instance_segmentation_mapping", "json"))
    semantics = load_json(
        path("instance_segmentation", "instance_segmentation_semantics_mapping", "json"))
    semantic = read(path("semantic_segmentation", "semantic_segmentation", "png"))
    labels = load_json(path("semantic_segmentation", "semantic_segmentation_labels", "json"))
    masks = {value: mask_of_key(instances, key) for key, value in mapping.items()}
    equal(sum(int(m.sum()) for m in masks.values()), h * w, "the masks fill the picture")
    for key, node in mapping.items():
        for other, label in labels.items():
            if (masks[node] & mask_of_key(semantic, other)).any():
                equal(label, semantics[key], f"label of {node}")

    tight = load_npy(path("bounding_box_2d_tight", "bounding_box_2d_tight", "npy"), BOX_2D)
    paths = load_json(path("bounding_box_2d_tight", "bounding_box_2d_tight_prim_paths", "json"))
    names = load_json(path("bounding_box_2d_tight", "bounding_box_2d_tight_labels", "json"))
    equal(len(paths), len(tight), "rows")
    for row, node in zip(tight, paths):
        box = [row["x_min"], row["y_min"], row["x_max"] + 1, row["y_max"] + 1]
        equal(box, extent(masks[node]), f"box of {node}")
        assert str(row["semanticId"]) in names
        assert 0.0 <= row["occlusionRatio"] <= 1.0
    cuboids = load_npy(path("bounding_box_3d", "bounding_box_3d", "npy"), BOX_3D)
    camera = load_json(path("camera_params", "camera_params", "json"))
    equal(camera["renderProductResolution"], [w, h], "resolution")
    to_clip = (np.array(camera["cameraViewTransform"]).reshape(4, 4)
               @ np.array(camera["cameraProjection"]).reshape(4, 4))
    nodes = load_json(path("bounding_box_3d", "bounding_box_3d_prim_paths", "json"))
    for row, node in zip(cuboids, nodes):
        if node not in masks or not masks[node].any():
            continue
        corners = np.array([[row["x_" + i], row["y_" + j], row["z_" + k], 1.0]
                            for i in ("min", "max") for j in ("min", "max")
                            for k in ("min", "max")])
        clip = corners @ row["transform"].astype(float) @ to_clip
        xs = (clip[:, 0] / clip[:, 3] + 1) / 2 * w
        ys = (1 - clip[:, 1] / clip[:, 3]) / 2 * h
        x0, y0, x1, y1 = extent(masks[node])
        assert xs.min() <= x0 + 0.6 and xs.max() >= x1 - 0.6, f"{node}: {xs} {x0} {x1}"
        assert ys.min() <= y0 + 0.6 and ys.max() >= y1 - 0.6, f"{node}: {ys} {y0} {y1}"
    load_npy(path("occlusion", "occlusion", "npy"), OCCLUSION)
    points = load_npy(path("pointcloud", "pointcloud", "npy"), "<f4")
    count = len(points)
    load_npy(path("pointcloud", "pointcloud_rgb", "npy"), "|u1", (count, 4))
    load_npy(path("pointcloud", "pointcloud_normals", "npy"), "<f4", (count, 4))
    load_npy(path("pointcloud", "pointcloud_semantic", "npy"), "<u4", (count,))
    load_npy(path("pointcloud", "pointcloud_instance", "npy"), "<u4", (count,))


def check_basic(root):
    for folder, common, raw in (("basic", False, False), ("basic_raw", True, True)):
        with open(f"{root}/{folder}/metadata.txt", encoding="utf-8") as file:
            equal(file.read(), '{"name": "BasicWriter", "version": "0.0.2", '
                  '"replicator_global_seed:": 12}', "metadata.txt")
        for product in ("rp_cam_0", "rp_cam_1"):
            for number in ("0000", "0001", "0002"):
                read_basic(f"{root}/{folder}", product, number, common, raw)


def check_pose(root):
    files = sorted(glob.glob(f"{root}/pose/rp_*/*.json"))
    equal(len(files), 6, "pose files")
    for path in files:
        data = load_json(path, indent=2)
        assert data["objects"], path
        for suffix in (".png", "_overlay.png"):
            picture(path[:-5] + suffix)


def decode(rle):
    height, width = rle["size"]
    counts, text, at = [], rle["counts"], 0
    while at < len(text):
        value = shift = 0
        while True:
            group = ord(text[at]) - 48
            at += 1
            value |= (group & 31) << shift
            shift += 5
            if not group & 32:
                break
        if group & 16:
            value -= 1 << shift
        if len(counts) > 2:
            value += counts[-2]
        counts.append(value)
    flat = np.repeat(np.arange(len(counts)) % 2, counts)
    return flat.reshape(width, height).T.astype(bool)


def check_coco(root):
    total = 0
    for split in ("train", "val"):
        data = load_json(f"{root}/coco/annotations/instances_{split}.json")
        panoptic = load_json(f"{root}/coco/annotations/panoptic_{split}.json")
        images = {image["id"]: image for image in data["images"]}
        taken = {}
        for image in images.values():
            shape = picture(f"{root}/coco/images/{split}/{image['file_name']}").shape
            equal(shape, (image["height"], image["width"], 3), image["file_name"])
            taken[image["id"]] = np.zeros(shape[:2], int)
        for annotation in data["annotations"]:
            total += 1
            mask = decode(annotation["segmentation"])
            equal(int(mask.sum()), annotation["area"], "area")
            x0, y0, x1, y1 = extent(mask)
            equal([x0, y0, x1 - x0, y1 - y0], annotation["bbox"], "bbox")
            assert (decode(annotation["amodal"]["segmentation"]) | ~mask).all()
            taken[annotation["image_id"]] += mask
        assert all(t.max() <= 1 for t in taken.values())
        for entry in panoptic["annotations"]:
            image = picture(f"{root}/coco/panoptic/{split}/{entry['file_name']}").astype(int)
            ids = image[:, :, 2] + 256 * image[:, :, 1] + 65536 * image[:, :, 0]
            equal((ids != 0), taken[entry["image_id"]] == 1, "panoptic and instances")
    assert total >= 15, total


def check_yolo(root):
    for task, fields in (("detect", 4), ("segment", None), ("pose", 31), ("obb", 8)):
        labels = glob.glob(f"{root}/yolo_{task}/labels/*/*.txt")
        equal(len(labels), 6, task)
        if yaml:
            with open(f"{root}/yolo_{task}/data.yaml", encoding="utf-8") as file:
                data = yaml.safe_load(file)
            equal(data["names"], {0: "ball", 1: "crate", 2: "mug"}, "names")
            equal(data.get("kpt_shape"), [9, 3] if task == "pose" else None, "kpt_shape")
            for split in ("train", "val"):
                assert os.path.isdir(f"{root}/yolo_{task}/{data[split]}")
        for path in labels:
            stem = path.replace("/labels/", "/images/")[:-4]
            image = picture(stem + ".png")
            with open(path, encoding="utf-8") as file:
                for line in file:
                    numbers = [float(word) for word in line.split()]
                    assert numbers[0] in (0, 1, 2)
                    if fields:
                        equal(len(numbers) - 1, fields, path)
                    if task == "segment":
                        polygon = np.array(numbers[1:]).reshape(-1, 2) * image.shape[1::-1]
                        assert cv2.contourArea(polygon.astype(np.float32)) >= 1.0


def check_kitti(root):
    for path in sorted(glob.glob(f"{root}/kitti/training/label_2/*.txt")):
        stem = os.path.basename(path)[:-4]
        image = picture(f"{root}/kitti/training/image_2/{stem}.png")
        depth = picture(f"{root}/kitti/training/depth_2/{stem}.png")
        equal(str(depth.dtype), "uint16", "depth")
        equal(depth.shape, image.shape[:2], "depth")
        with open(path, encoding="utf-8") as file:
            for line in file:
                equal(len(line.split()), 15, path)


def check_voc(root):
    files = glob.glob(f"{root}/voc/Annotations/*.xml")
    equal(len(files), 6, "annotations")
    for path in files:
        tree = ElementTree.parse(path).getroot()
        image = picture(f"{root}/voc/JPEGImages/{tree.findtext('filename')}")
        equal(image.shape, tuple(int(tree.find("size").findtext(k))
                                 for k in ("height", "width", "depth")), path)
        stem = os.path.basename(path)[:-4]
        objects = picture(f"{root}/voc/SegmentationObject/{stem}.png")
        for place, element in enumerate(tree.iter("object"), start=1):
            box = [int(element.find("bndbox").findtext(k)) for k in ("xmin", "ymin", "xmax", "ymax")]
            x0, y0, x1, y1 = extent(objects == place)
            equal(box, [x0 + 1, y0 + 1, x1, y1], f"{path}: object {place}")


def check_bop(root):
    scenes = glob.glob(f"{root}/bop/*/*/scene_gt.json")
    assert len(scenes) >= 2
    for path in scenes:
        scene = os.path.dirname(path)
        poses = load_json(path, indent=2, newline="\n")
        infos = load_json(f"{scene}/scene_gt_info.json", indent=2, newline="\n")
        cameras = load_json(f"{scene}/scene_camera.json", indent=2, newline="\n")
        for image, objects in poses.items():
            stem = f"{int(image):06d}"
            depth = picture(f"{scene}/depth/{stem}.png")
            equal(str(depth.dtype), "uint16", "depth")
            equal(np.array(cameras[image]["cam_K"]).shape, (9,), "cam_K")
            for i, (pose, info) in enumerate(zip(objects, infos[image])):
                rotation = np.array(pose["cam_R_m2c"]).reshape(3, 3)
                assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
                mask = picture(f"{scene}/mask_visib/{stem}_{i:06d}.png")
                equal(int((mask == 255).sum()), info["px_count_visib"], "visible pixels")


def check_webdataset(root):
    shards = glob.glob(f"{root}/webdataset/shards/*.tar")
    equal(len(shards), 3, "shards")
    for shard in shards:
        with tarfile.open(shard) as archive:
            members = {m.name: archive.extractfile(m).read() for m in archive.getmembers()}
        equal(len(members), 8, shard)
        for name, content in members.items():
            if not name.endswith(".json"):
                continue
            sample = json.loads(content)
            key = name[:-5]
            depth = np.load(io.BytesIO(members[key + ".depth.npy"]))
            equal(depth.shape, (sample["height"], sample["width"]), key)
            ids = cv2.imdecode(np.frombuffer(members[key + ".instances.png"], np.uint8),
                               cv2.IMREAD_UNCHANGED)
            for place, item in enumerate(sample["objects"], start=1):
                equal(extent(ids == place), item["box"], key)


def main():
    with tempfile.TemporaryDirectory() as root:
        if len(sys.argv) > 2:
            root = sys.argv[2]
        subprocess.run([sys.argv[1], root], check=True)
        for check in (check_basic, check_pose, check_coco, check_yolo, check_kitti, check_voc,
                      check_bop, check_webdataset):
            check(root)
            print(check.__name__, "ok")
        for path in glob.glob(f"{root}/boxes/rp_*/*.png"):
            assert picture(path).shape[2] == 4


if __name__ == "__main__":
    main()
