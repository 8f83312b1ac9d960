#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""read_back.py WRITE_SAMPLE_DATASETS: reads what the writers make with the readers that people use
(numpy, OpenCV, json, tarfile, ElementTree) and compares the files with each other."""
import configparser
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
try:
    import h5py
except ImportError:
    h5py = None

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
    ray = load_npy(path("distance_to_camera", "distance_to_camera", "npy"), "<f4", (h, w))
    plane = load_npy(path("distance_to_image_plane", "distance_to_image_plane", "npy"), "<f4",
                     (h, w))
    assert (ray >= plane).all() and np.isinf(ray).any() and np.isfinite(ray).any()
    motion = load_npy(path("motion_vectors", "motion_vectors", "npy"), "<f4", (h, w, 4))
    # The sample moves (x / 4, -y / 2) pixels to the right and down; the format counts left and up.
    hit = np.isfinite(ray)
    ys, xs = np.nonzero(hit)
    equal(motion[hit][:, :2], np.stack([-0.25 * xs, 0.5 * ys], axis=1), "motion")
    assert not motion[~hit].any() and not motion[:, :, 2:].any()
    gray = picture(path("distance_to_camera", "distance_to_camera", "png"))
    equal(str(gray.dtype), "uint8", "gray")
    assert (gray[~hit] == 0).all() and gray[hit].max() >= 253
    normals = rgba(path("normals", "normals", "png"))
    equal(normals[:, :, 3], np.where(hit, 255, 127), "alpha of normals")
    lengths = np.linalg.norm((normals[hit][:, :3] + 0.5) / 127.5 - 1.0, axis=1)
    assert (abs(lengths - 1.0) < 0.02).all(), lengths

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

    leaves = read(path("instance_id_segmentation", "instance_id_segmentation", "png"))
    leaf_paths = load_json(
        path("instance_id_segmentation", "instance_id_segmentation_mapping", "json"))
    # An instance's pixels are those of the meshes at or below its node.
    for node, mask in masks.items():
        if not node.startswith("/") or not mask.any():
            continue
        below = np.zeros((h, w), bool)
        for key, leaf in leaf_paths.items():
            if leaf == node or leaf.startswith(node + "/"):
                below |= mask_of_key(leaves, key)
        equal(below, mask, f"leaves below {node}")

    loose = load_npy(path("bounding_box_2d_loose", "bounding_box_2d_loose", "npy"), BOX_2D)
    loose_paths = load_json(
        path("bounding_box_2d_loose", "bounding_box_2d_loose_prim_paths", "json"))
    loose_of = dict(zip(loose_paths, loose))
    tight = load_npy(path("bounding_box_2d_tight", "bounding_box_2d_tight", "npy"), BOX_2D)
    paths = load_json(path("bounding_box_2d_tight", "bounding_box_2d_tight_prim_paths", "json"))
    names = load_json(path("bounding_box_2d_tight", "bounding_box_2d_tight_labels", "json"))
    equal(len(paths), len(tight), "rows")
    for row, node in zip(tight, paths):
        box = [row["x_min"], row["y_min"], row["x_max"] + 1, row["y_max"] + 1]
        equal(box, extent(masks[node]), f"box of {node}")
        assert str(row["semanticId"]) in names
        assert 0.0 <= row["occlusionRatio"] <= 1.0
        outer = loose_of[node]
        assert outer["x_min"] <= row["x_min"] and outer["y_min"] <= row["y_min"]
        assert outer["x_max"] >= row["x_max"] and outer["y_max"] >= row["y_max"]
        equal(outer["occlusionRatio"], row["occlusionRatio"], f"occlusion of {node}")
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
    occlusion = load_npy(path("occlusion", "occlusion", "npy"), OCCLUSION)
    ratios = occlusion["occlusionRatio"]
    assert (((ratios >= 0.0) & (ratios <= 1.0)) | (ratios == -1.0)).all(), ratios
    for ratio in tight["occlusionRatio"]:
        assert np.isclose(ratios, ratio).any(), f"{ratio} is not in {ratios}"
    points = load_npy(path("pointcloud", "pointcloud", "npy"), "<f4")
    count = len(points)
    equal(points.shape, (count, 3), "points")
    load_npy(path("pointcloud", "pointcloud_rgb", "npy"), "|u1", (count, 4))
    normals = load_npy(path("pointcloud", "pointcloud_normals", "npy"), "<f4", (count, 4))
    assert np.allclose(np.linalg.norm(normals[:, :3], axis=1), 1.0, atol=1e-5)
    load_npy(path("pointcloud", "pointcloud_semantic", "npy"), "<u4", (count,))
    load_npy(path("pointcloud", "pointcloud_instance", "npy"), "<u4", (count,))
    # Points are the labelled pixels at their distance.
    camera_points = np.c_[points, np.ones(count)] @ np.array(
        camera["cameraViewTransform"]).reshape(4, 4)
    labelled = np.zeros((h, w), bool)
    for node, mask in masks.items():
        labelled |= mask if node.startswith("/") else False
    equal(count, int(labelled.sum()), "points and labelled pixels")
    distances = np.sort(np.linalg.norm(camera_points[:, :3], axis=1))
    assert np.allclose(distances, np.sort(ray[labelled]), atol=1e-5)


def check_basic(root):
    for folder, common, raw in (("basic", False, False), ("basic_raw", True, True)):
        with open(f"{root}/{folder}/metadata.txt", encoding="utf-8") as file:
            equal(file.read(), '{"name": "BasicWriter", "version": "0.0.2", '
                  '"replicator_global_seed:": 12}', "metadata.txt")
        for product in ("rp_cam_0", "rp_cam_1"):
            for number in ("0000", "0001", "0002"):
                read_basic(f"{root}/{folder}", product, number, common, raw)


def rotation_of(x, y, z, w):
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def check_corners(names, centre, rotation, size, corners):
    """The names say the sides: L/R, D/U, B/F are min/max of x, y, z."""
    for name, corner in zip(names, corners):
        side = [0, 0, 0] if name == "Center" else [1 if a == b else -1 for a, b in zip(name, "RUF")]
        expected = centre + rotation @ (np.array(side) * size / 2)
        assert np.allclose(expected, corner, atol=0.02 * np.linalg.norm(size)), (name, corner)


def check_pose(root):
    for folder in ("pose", "pose_dope", "pose_centerpose"):
        files = sorted(glob.glob(f"{root}/{folder}/rp_*/*.json"))
        equal(len(files), 6, "pose files")
        for path in files:
            data = load_json(path, indent=2)
            assert data["objects"], path
            names = data["keypoint_order"]
            equal(len(names), 9, path)
            shape = picture(path[:-5] + ".png").shape
            equal(picture(path[:-5] + "_overlay.png").shape, shape, path)
            for item in data["objects"]:
                assert 0.0 < item["visibility"] <= 1.0
                pixels = item.get("projected_cuboid") or item["cuboid_keypoints_projected"]
                assert all(isinstance(v, int) for pixel in pixels for v in pixel), path
                if folder == "pose_dope":
                    quaternion = item["quaternion_xyzw"]
                elif folder == "pose_centerpose":
                    quaternion = item["quaternion_xyzw"]
                    points = np.array(item["keypoints_3d"])
                    check_corners(names, points[0], rotation_of(*quaternion),
                                  np.array(item["scale"]), points)
                else:
                    w, x, y, z = item["quat_wxyz_camera_frame"]
                    quaternion = x, y, z, w
                    points = np.array(item["cuboid_keypoints_camera_frame"])
                    check_corners(names, points[0], rotation_of(x, y, z, w),
                                  np.array(item["size"]), points)
                assert abs(np.linalg.norm(quaternion) - 1.0) < 1e-6


def check_boxes(root):
    files = glob.glob(f"{root}/boxes/rp_*/*.png")
    equal(len(files), 18, "three kinds of pictures of six frames")
    for path in files:
        image = picture(path)
        camera = "cam_0" if "rp_cam_0" in path else "cam_1"
        equal(image.shape, SIZES[camera] + (4,), path)


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


def check_occlusion_order(wholes):
    """Where one is seen and the other reaches, the order has it in front."""
    pairs = 0
    for (image, node), (_, whole, amodal) in wholes.items():
        counts = {front["node"]: front["pixels"] for front in amodal["occluded_by"]}
        for (other_image, other), (seen, _, _) in wholes.items():
            if other_image != image or other == node:
                continue
            shared = int((seen & whole).sum())
            assert counts.get(other, 0) >= shared, (image, node, other)
            pairs += shared > 0
    return pairs


def check_coco(root):
    total = 0
    ordered = 0
    for split in ("train", "val"):
        data = load_json(f"{root}/coco/annotations/instances_{split}.json")
        panoptic = load_json(f"{root}/coco/annotations/panoptic_{split}.json")
        images = {image["id"]: image for image in data["images"]}
        taken = {}
        wholes = {}
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
            whole = decode(annotation["amodal"]["segmentation"])
            assert (whole | ~mask).all()
            taken[annotation["image_id"]] += mask
            wholes[annotation["image_id"], annotation["node"]] = (mask, whole, annotation["amodal"])
        ordered += check_occlusion_order(wholes)
        assert all(t.max() <= 1 for t in taken.values())
        for entry in panoptic["annotations"]:
            image = picture(f"{root}/coco/panoptic/{split}/{entry['file_name']}").astype(int)
            ids = image[:, :, 2] + 256 * image[:, :, 1] + 65536 * image[:, :, 0]
            equal((ids != 0), taken[entry["image_id"]] == 1, "panoptic and instances")
    assert total >= 15, total
    assert ordered > 0


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
                # Without a path, trainers take the folder of data.yaml.
                assert "path" not in data
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
    # The development kit's colours: bits of the index by turns to red, green and blue.
    palette = np.array([[sum(((i >> (3 * j + c)) & 1) << (7 - j) for j in range(3))
                         for c in range(3)] for i in range(256)])
    number = {tuple(color): i for i, color in enumerate(palette)}
    for path in files:
        tree = ElementTree.parse(path).getroot()
        image = picture(f"{root}/voc/JPEGImages/{tree.findtext('filename')}")
        equal(image.shape, tuple(int(tree.find("size").findtext(k))
                                 for k in ("height", "width", "depth")), path)
        stem = os.path.basename(path)[:-4]
        colors = cv2.cvtColor(picture(f"{root}/voc/SegmentationObject/{stem}.png"),
                              cv2.COLOR_BGR2RGB)
        objects = np.array([[number[tuple(c)] for c in row] for row in colors.tolist()])
        for place, element in enumerate(tree.iter("object"), start=1):
            box = [int(element.find("bndbox").findtext(k)) for k in ("xmin", "ymin", "xmax", "ymax")]
            x0, y0, x1, y1 = extent(objects == place)
            equal(box, [x0 + 1, y0 + 1, x1, y1], f"{path}: object {place}")


def load_lines(path, brackets):
    """A list or an object with a line per element, each as Python would write it."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    value = json.loads(text)
    if brackets == "{}":
        lines = [f"  {json.dumps(key)}: {json.dumps(element)}" for key, element in value.items()]
    else:
        lines = ["  " + json.dumps(element) for element in value]
    expected = brackets[0] + "\n" + ",\n".join(lines) + "\n" + brackets[1] + "\n"
    equal(text, expected if lines else brackets + "\n", path)
    return value


def load_ply(path):
    """Corners and triangles."""
    with open(path, "rb") as file:
        data = file.read()
    header, body = data.split(b"end_header\n", 1)
    counts = {words[1]: int(words[2]) for words in
              (line.split() for line in header.decode().split("\n")) if words[:1] == ["element"]}
    vertex = np.dtype([("place", "<f4", 3), ("normal", "<f4", 3), ("color", "u1", 3)])
    face = np.dtype([("count", "u1"), ("corners", "<i4", 3)])
    vertices = np.frombuffer(body, vertex, counts["vertex"])
    faces = np.frombuffer(body[27 * len(vertices):], face, counts["face"])
    assert (faces["count"] == 3).all()
    return vertices["place"].astype(float), faces["corners"]


def silhouette(points, triangles, k, size):
    """The pixels of a picture of three times the size round the picture, drawn by OpenCV."""
    height, width = size
    pixels = points @ k.T
    pixels = pixels[:, :2] / pixels[:, 2:] + [width, height] - 0.5  # OpenCV's centres are whole
    mask = np.zeros((3 * height, 3 * width), np.uint8)
    shift = 8
    for triangle in triangles:
        corners = np.round(pixels[triangle] * (1 << shift)).astype(np.int32)
        cv2.fillConvexPoly(mask, corners, 1, cv2.LINE_8, shift)
    return mask


def check_silhouette(info, mask, size, what):
    """OpenCV draws borders too, so a pixel all round is allowed."""
    height, width = size
    inner = cv2.erode(mask, np.ones((3, 3), np.uint8))
    count = info["px_count_all"]
    assert inner.sum() <= count <= mask.sum(), (what, inner.sum(), count, mask.sum())
    share = info["px_count_visib"] / count
    assert abs(info["visib_fract"] - share) < 1e-9, (what, info["visib_fract"], share)
    ys, xs = np.nonzero(mask)
    box = [xs.min() - width, ys.min() - height, xs.max() - xs.min(), ys.max() - ys.min()]
    assert all(abs(a - b) <= 2 for a, b in zip(info["bbox_obj"], box)), (what, info, box)
    return xs.min() < width or ys.min() < height or xs.max() >= 2 * width or ys.max() >= 2 * height


def check_models(root):
    models = {}
    for key, info in load_json(f"{root}/bop/models/models_info.json", indent=2,
                               newline="\n").items():
        path = f"{root}/bop/models/obj_{int(key):06d}.ply"
        if not os.path.exists(path):
            continue
        points, triangles = models[int(key)] = load_ply(path)
        distances = np.linalg.norm(points[:, None] - points[None], axis=2)
        assert abs(distances.max() - info["diameter"]) < 1e-3, (key, distances.max(), info)
        for axis, name in enumerate("xyz"):
            assert abs(points[:, axis].min() - info["min_" + name]) < 1e-3
            assert abs(np.ptp(points[:, axis]) - info["size_" + name]) < 1e-3
        for matrix in info.get("symmetries_discrete", []):
            turn = np.array(matrix).reshape(4, 4)
            turned = points @ turn[:3, :3].T + turn[:3, 3]
            nearest = np.linalg.norm(turned[:, None] - points[None], axis=2).min(axis=1)
            assert nearest.max() < 0.05 * info["diameter"], (key, nearest.max())
    assert models
    return models


def check_bop(root):
    models = check_models(root)
    scenes = glob.glob(f"{root}/bop/*/*/scene_gt.json")
    assert len(scenes) >= 2
    drawn = 0
    targets = []
    for path in sorted(scenes):
        scene = os.path.dirname(path)
        poses = load_lines(path, "{}")
        infos = load_lines(f"{scene}/scene_gt_info.json", "{}")
        cameras = load_lines(f"{scene}/scene_camera.json", "{}")
        for image, objects in poses.items():
            stem = f"{int(image):06d}"
            depth = picture(f"{scene}/depth/{stem}.png")
            equal(str(depth.dtype), "uint16", "depth")
            k = np.array(cameras[image]["cam_K"]).reshape(3, 3)
            for i, (pose, info) in enumerate(zip(objects, infos[image])):
                rotation = np.array(pose["cam_R_m2c"]).reshape(3, 3)
                assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
                mask = picture(f"{scene}/mask_visib/{stem}_{i:06d}.png")
                equal(int((mask == 255).sum()), info["px_count_visib"], "visible pixels")
                x0, y0, x1, y1 = extent(mask)
                equal(info["bbox_visib"], [x0, y0, x1 - 1 - x0, y1 - 1 - y0], "bbox_visib")
                if "/test/" in path and info["visib_fract"] >= 0.1:
                    targets.append((int(os.path.basename(scene)), int(image), pose["obj_id"]))
                if pose["obj_id"] not in models:
                    continue
                points, triangles = models[pose["obj_id"]]
                placed = points @ rotation.T + np.array(pose["cam_t_m2c"])
                whole = silhouette(placed, triangles, k, depth.shape)
                check_silhouette(info, whole, depth.shape, f"{scene} {image} {i}")
                drawn += 1
    assert drawn >= 4, drawn
    listed = load_lines(f"{root}/bop/test_targets_bop19.json", "[]")
    equal(sorted((t["scene_id"], t["im_id"], t["obj_id"]) for t in listed for _ in
                 range(t["inst_count"])), sorted(targets), "targets")


def check_polygons(root):
    """OpenCV fills COCO's polygons: their pixels and those of the run lengths differ by borders."""
    for split in ("train", "val"):
        runs = load_json(f"{root}/coco/annotations/instances_{split}.json")
        polygons = load_json(f"{root}/coco_polygon/annotations/instances_{split}.json")
        licences = [entry["id"] for entry in polygons["licenses"]]
        assert all(image["license"] in licences for image in polygons["images"])
        equal(len(runs["annotations"]), len(polygons["annotations"]), "annotations")
        for exact, annotation in zip(runs["annotations"], polygons["annotations"]):
            mask = decode(exact["segmentation"]).astype(np.uint8)
            # Enlarged, so that pixel edges are between the enlarged pixels' centres.
            large = np.zeros([8 * n for n in mask.shape], np.uint8)
            for polygon in annotation["segmentation"]:
                corners = np.array(polygon).reshape(-1, 2) * 8
                cv2.fillPoly(large, [corners.astype(np.int32)], 1)
            equal(large[4::8, 4::8], mask, "pixels of polygons")


def check_imagefolder(root):
    lines = 0
    for split in ("train", "validation"):
        folder = f"{root}/imagefolder/{split}"
        with open(f"{folder}/metadata.jsonl", encoding="utf-8") as file:
            for text in file:
                line = json.loads(text)
                lines += 1
                shape = picture(f"{folder}/{line['file_name']}").shape
                equal(shape, (line["height"], line["width"], 3), line["file_name"])
                objects = line["objects"]
                equal(len(objects["bbox"]), len(objects["categories"]), line["file_name"])
                for x, y, width, height in objects["bbox"]:
                    assert 0 <= x and 0 <= y and x + width <= shape[1] and y + height <= shape[0]
    equal(lines, 6, "lines of metadata.jsonl")


def check_page(root):
    for folder in ("coco", "yolo_detect", "kitti", "voc", "bop", "webdataset", "hdf5"):
        page = load_json(f"{root}/{folder}/dataset.json", indent=2, newline="\n")
        equal(page["seed"], 12, folder)
        equal(page["job"], "seed: 12\n", folder)
        equal(page["classes"], ["ball", "crate", "mug"], folder)
        equal(sorted(sum(page["split"].values(), [])), [0, 1, 2], folder)
        assert page["split"]["val"], folder
        equal(page["plugins"], {"writer_basic": "1.0.0"}, folder)
        equal(page["assets"][0]["files"][1], {"file": "/props/textures/mug.png", "sha256": "b" * 64},
              folder)
        for key in ("units", "world_axes", "camera_axes", "pixels", "boxes", "rotations", "depth"):
            assert isinstance(page["conventions"][key], str), (folder, key)


def check_hdf5(root):
    files = glob.glob(f"{root}/hdf5/*/*.hdf5")
    equal(len(files), 6, "files")
    if not h5py:
        print("python3-h5py is absent: contents of HDF5 files are left to the C++ tests")
        return
    for path in files:
        h, w = SIZES[path[-10:-5]]
        with h5py.File(path, "r") as file:
            for name, shape, dtype in (("colors", (h, w, 3), "uint8"), ("depth", (h, w), "float32"),
                                       ("normals", (h, w, 3), "float32"),
                                       ("instance_segmaps", (h, w), "uint16"),
                                       ("category_id_segmaps", (h, w), "uint16"),
                                       ("cam_K", (3, 3), "float64"),
                                       ("world_from_camera", (4, 4), "float64")):
                equal(file[name].shape, shape, f"{path}: {name}")
                equal(str(file[name].dtype), dtype, f"{path}: {name}")
            objects = json.loads(file["instance_attribute_maps"][()])
            equal(set(np.unique(file["instance_segmaps"])) - {0}, {o["idx"] for o in objects}, path)


def check_across(root):
    """The same frames in all formats: pictures, depth and boxes are the same."""
    classes = ["ball", "crate", "mug"]
    for capture in range(3):
        for camera, (h, w) in SIZES.items():
            stem = f"{capture:06d}_{camera}"
            number = f"{2 * capture + int(camera[-1]):06d}"
            basic = f"{root}/basic/rp_{camera}"
            rgb = picture(f"{basic}/rgb/rgb_{capture:04d}.png")[:, :, :3]
            depth = np.load(f"{basic}/distance_to_image_plane/"
                            f"distance_to_image_plane_{capture:04d}.npy")
            bop = glob.glob(f"{root}/bop/*/{int(camera[-1]):06d}/rgb/{capture:06d}.png")[0]
            for path in (f"{root}/kitti/training/image_2/{number}.png", bop,
                         glob.glob(f"{root}/coco/images/*/{stem}.png")[0],
                         glob.glob(f"{root}/yolo_obb/images/*/{stem}.png")[0]):
                equal(picture(path), rgb, path)
            known = np.isfinite(depth)
            for path, unit in ((bop.replace("/rgb/", "/depth/"), 1e-4),
                               (f"{root}/kitti/training/depth_2/{number}.png", 1.0 / 256.0)):
                found = picture(path) * unit
                equal(found > 0, known, path)
                assert (abs(found - depth)[known] <= 0.51 * unit).all(), path
            with tarfile.open(f"{root}/webdataset/shards/{capture:06d}.tar") as archive:
                equal(np.load(io.BytesIO(archive.extractfile(f"{stem}.depth.npy").read())), depth,
                      stem)
                sample = json.load(archive.extractfile(f"{stem}.json"))
            boxes = sorted((o["class"], o["box"]) for o in sample["objects"])
            assert boxes, stem

            def yolo_box(line):
                index, x, y, width, height = (float(word) for word in line.split())
                corners = np.array([x - width / 2, y - height / 2, x + width / 2, y + height / 2])
                return classes[int(index)], np.rint(corners * [w, h, w, h]).astype(int).tolist()

            with open(glob.glob(f"{root}/yolo_detect/labels/*/{stem}.txt")[0],
                      encoding="utf-8") as file:
                found = sorted(map(yolo_box, file))
            assert [list(f) for f in found] == [list(b) for b in boxes], (found, boxes)
            with open(f"{root}/kitti/training/label_2/{number}.txt", encoding="utf-8") as file:
                words = [line.split() for line in file]
            found = sorted((v[0], [int(float(x)) for x in v[4:8]]) for v in words)
            assert found == boxes, (found, boxes)
            tree = ElementTree.parse(f"{root}/voc/Annotations/{stem}.xml").getroot()
            voc = [(e.findtext("name"), [int(e.find("bndbox").findtext(k)) - (k[1:] == "min")
                                         for k in ("xmin", "ymin", "xmax", "ymax")])
                   for e in tree.iter("object")]
            assert sorted(voc) == boxes, (voc, boxes)


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


def check_mot(root):
    """A sequence as TrackEval and mmtracking take it: comma-separated columns, an ini file, pictures
    that count from 1."""
    folders = sorted(glob.glob(f"{root}/clips/mot/*/*/"))
    equal(len(folders), len(SIZES), "sequences")
    for folder in folders:
        camera = folder.rstrip("/")[-5:]
        h, w = SIZES[camera]
        page = configparser.ConfigParser()
        page.read(folder + "seqinfo.ini")
        page = page["Sequence"]
        equal(page["name"], os.path.basename(folder.rstrip("/")), "name of the sequence")
        equal([int(page[key]) for key in ("frameRate", "imWidth", "imHeight")], [10, w, h], folder)
        pictures = sorted(glob.glob(f"{folder}{page['imDir']}/*{page['imExt']}"))
        equal([os.path.basename(path)[:6] for path in pictures],
              [f"{i + 1:06d}" for i in range(int(page["seqLength"]))], folder)
        rows = np.loadtxt(folder + "gt/gt.txt", delimiter=",", ndmin=2)
        equal(rows.shape[1], 9, "columns")
        assert (rows[:, 6] == 1).all() and (rows[:, 7] >= 1).all()
        assert (rows[:, 8] > 0).all() and (rows[:, 8] <= 1).all()
        for frame, path in enumerate(pictures):
            basic = f"{root}/clips/basic/rp_{camera}"
            equal(picture(path), picture(f"{basic}/rgb/rgb_{frame:04d}.png")[:, :, :3], path)
            tight = f"{basic}/bounding_box_2d_tight/bounding_box_2d_tight"
            boxes = np.load(f"{tight}_{frame:04d}.npy")
            own = rows[rows[:, 0] == frame + 1]
            equal(len(set(own[:, 1])), len(own), "tracks of a frame")
            known = {(b["x_min"] + 1, b["y_min"] + 1, b["x_max"] - b["x_min"] + 1,
                      b["y_max"] - b["y_min"] + 1) for b in boxes}
            assert len(own) > 0 and {tuple(row) for row in own[:, 2:6].astype(int)} <= known, path


def check_video(root):
    files = glob.glob(f"{root}/clips/video/*.mp4")
    if not files:
        print("VideoWriter was not built: its files are left out")
        return
    equal(len(files), 1, "videos")
    video = cv2.VideoCapture(files[0])
    assert video.isOpened() and abs(video.get(cv2.CAP_PROP_FPS) - 10.0) < 1e-6, files[0]
    count = 0
    while True:
        is_there, frame = video.read()
        if not is_there:
            break
        left = 0
        for camera, (h, w) in SIZES.items():
            rgb = picture(f"{root}/clips/basic/rp_{camera}/rgb/rgb_{count:04d}.png")[:, :, :3]
            assert cv2.PSNR(frame[:h, left:left + w], rgb) > 25.0, (files[0], count, camera)
            left += w
        count += 1
    equal(count, len(glob.glob(f"{root}/clips/basic/rp_cam_0/rgb/*.png")), "frames of the video")


def check_torchvision(root):
    """Loaders of a training library, which look for the benchmarks' own folders."""
    try:
        from torchvision import datasets
    except ImportError:
        print("torchvision is absent: its loaders are left out")
        return
    with tempfile.TemporaryDirectory() as folder:
        os.makedirs(f"{folder}/VOCdevkit")
        os.symlink(os.path.abspath(f"{root}/voc"), f"{folder}/VOCdevkit/VOC2012")
        os.makedirs(f"{folder}/Kitti")
        os.symlink(os.path.abspath(f"{root}/kitti"), f"{folder}/Kitti/raw")
        voc = datasets.VOCDetection(folder, "2012", "trainval")
        equal(len(voc), len(glob.glob(f"{root}/voc/JPEGImages/*")), "pictures of VOC")
        for image, entry in voc:
            size = entry["annotation"]["size"]
            equal((int(size["width"]), int(size["height"])), image.size, "size in VOC")
            for thing in entry["annotation"].get("object", []):
                box = {side: int(thing["bndbox"][side]) for side in thing["bndbox"]}
                assert 1 <= box["xmin"] <= box["xmax"] <= image.size[0], thing
                assert 1 <= box["ymin"] <= box["ymax"] <= image.size[1], thing
        for image, mask in datasets.VOCSegmentation(folder, "2012", "trainval"):
            equal(mask.size, image.size, "size of a mask of VOC")
            equal(mask.mode, "P", "mask of VOC")
        kitti = datasets.Kitti(folder, train=True)
        equal(len(kitti), len(glob.glob(f"{root}/kitti/training/image_2/*")), "pictures of KITTI")
        for image, things in kitti:
            for thing in things:
                left, top, right, bottom = thing["bbox"]
                assert 0 <= left <= right <= image.size[0], thing
                assert 0 <= top <= bottom <= image.size[1], thing
                equal(len(thing["dimensions"]), 3, "dimensions in KITTI")
        assert sum(len(things) for _, things in kitti) > 0


def main():
    with tempfile.TemporaryDirectory() as root:
        if len(sys.argv) > 2:
            root = sys.argv[2]
        subprocess.run([sys.argv[1], root], check=True)
        for check in (check_basic, check_pose, check_boxes, check_page, check_coco, check_yolo,
                      check_kitti, check_voc, check_bop, check_polygons, check_imagefolder,
                      check_webdataset, check_hdf5, check_across, check_mot, check_video,
                      check_torchvision):
            check(root)
            print(check.__name__, "ok")


if __name__ == "__main__":
    main()
