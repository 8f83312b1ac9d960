#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Judges a clip's dataset by its files alone, with nothing of the program: numpy, OpenCV and SciPy read them.

    diorama run configs/clip.yaml && tests/clips/check_clip.py _out_diorama_clip [--pictures FOLDER]

- Flow: every point that a frame shows is found by depth and camera, carried on by the pose of its object, and
  projected into the next (last) frame. States are held against the ids and depths of the frame that they are about.
- Pictures warped by flow lie closer to those that they lead to than unwarped ones, and OpenCV's optical flow agrees.
- Ids: one node has one id in all frames and cameras, velocities lead from place to place.
- MOT Challenge, KITTI tracking, COCO and YouTube-VIS by the rules that their tools enforce (TrackEval, pycocotools,
  mmtracking), each against the ids of BasicWriter's pictures, and scored as each other's trackers (MOTA, IDF1).
- MP4: OpenCV's and, where there is one, ffprobe's count of frames; what is decoded is the pictures.

Ends with "0 faults" and 0, or tells the faults and ends with 1. Without one of the libraries it ends with 77.
"""
import argparse
import configparser
import json
import pathlib
import shutil
import subprocess
import sys

try:
    import cv2
    import numpy as np
    from scipy.optimize import linear_sum_assignment
except ImportError as missing:
    print(f"skipped: {missing}; python3-numpy, python3-opencv and python3-scipy are needed")
    sys.exit(77)

FAULTS = []


def check(holds, what):
    if not holds:
        FAULTS.append(what)


class View:
    """What one camera shows in one frame."""

    def __init__(self, folder, number):
        def file(kind, ending, stem=None):
            return folder / kind / f"{stem or kind}_{number:04d}{ending}"

        camera = json.loads(file("camera_params", ".json").read_text())
        self.width, self.height = camera["renderProductResolution"]
        view = np.array(camera["cameraViewTransform"]).reshape(4, 4).T
        self.camera_from_world = np.diag([1.0, -1.0, -1.0, 1.0]) @ view  # y down, z ahead
        projection = np.array(camera["cameraProjection"]).reshape(4, 4)
        self.fx, self.fy = 0.5 * self.width * projection[0, 0], 0.5 * self.height * projection[1, 1]
        self.depth = np.load(file("distance_to_image_plane", ".npy")).astype(float)
        self.flow = {way: np.load(file(f"flow_{way}", ".npy")) for way in ("forward", "backward")}
        self.state = {way: np.load(file(f"flow_{way}_state", ".npy")) for way in ("forward", "backward")}
        ids = cv2.imread(str(file("instance_segmentation", ".png")), cv2.IMREAD_UNCHANGED)
        if ids.ndim == 3:  # packed as RGBA, which OpenCV reads as BGRA
            ids = ids[:, :, [2, 1, 0, 3]].astype(np.uint32) @ np.array([1, 1 << 8, 1 << 16, 1 << 24], np.uint32)
        self.ids = ids.astype(np.int64)
        mapping = json.loads(file("instance_segmentation", ".json", "instance_segmentation_mapping").read_text())
        self.paths = {int(key): path for key, path in mapping.items()}
        boxes = np.load(file("bounding_box_3d", ".npy"))
        names = json.loads(file("bounding_box_3d", ".json", "bounding_box_3d_prim_paths").read_text())
        self.poses = {name: box["transform"].astype(float).T for name, box in zip(names, boxes)}
        self.velocities = json.loads(file("velocities", ".json").read_text())
        self.picture = cv2.imread(str(file("rgb", ".png")))

    def points(self):
        y, x = np.mgrid[0:self.height, 0:self.width] + 0.5
        z = self.depth
        points = np.stack([(x - 0.5 * self.width) / self.fx * z, (y - 0.5 * self.height) / self.fy * z, z,
                           np.ones_like(z)], axis=-1)
        return points @ np.linalg.inv(self.camera_from_world).T

    def project(self, points):
        seen = points @ self.camera_from_world.T
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.stack([seen[..., 0] / seen[..., 2] * self.fx + 0.5 * self.width,
                             seen[..., 1] / seen[..., 2] * self.fy + 0.5 * self.height], axis=-1), seen[..., 2]

    def objects(self):
        return {i: path for i, path in self.paths.items() if path.startswith("/Assets")}


def check_flow(a, b, way, sums):
    """From a to b; what has left b's picture has no pose in its files, and is not looked at."""
    is_hit = np.isfinite(a.depth) & (a.depth > 0) & (a.depth < 1e9)
    points = np.where(is_hit[..., None], a.points(), np.array([0.0, 0.0, 0.0, 1.0]))
    known = is_hit.copy()
    for number, path in a.paths.items():
        mask = a.ids == number
        if not mask.any() or path not in a.poses:
            continue
        if path in b.poses:
            points[mask] = points[mask] @ (b.poses[path] @ np.linalg.inv(a.poses[path])).T
        else:
            known &= ~mask
    expected, depth = b.project(points)
    y, x = np.mgrid[0:a.height, 0:a.width] + 0.5
    found = np.stack([x, y], axis=-1) + a.flow[way]
    state = a.state[way]
    check((state[~is_hit] == 3).all(), f"{way}: pixels without a surface have a state other than 3")
    off = np.linalg.norm(found - expected, axis=-1)
    seen, hidden = known & (state == 0), known & (state == 1)
    sums["off"].append(off[seen])
    inside = (found[..., 0] >= 0) & (found[..., 1] >= 0) & (found[..., 0] < a.width) & (found[..., 1] < a.height)
    sums["wrong_inside"] += int((inside[known] != (state[known] != 2)).sum())
    at = np.clip(np.floor(found).astype(int), 0, [a.width - 1, a.height - 1])
    there = b.ids[at[..., 1], at[..., 0]]
    sums["seen"] += int(seen.sum())
    sums["outside"] += int((known & (state == 2)).sum())
    sums["hidden"] += int(hidden.sum())
    sums["other_ids"] += int((there[seen] != a.ids[seen]).sum())
    nearest = cv2.erode(b.depth.astype(np.float32), np.ones((3, 3), np.uint8))[at[..., 1], at[..., 0]]
    sums["not_hidden"] += int((nearest[hidden] > depth[hidden] + 1e-3).sum())


def check_pictures(a, b, sums):
    """The next picture fetched back by flow is this one, and a flow that is read off the pictures agrees."""
    y, x = np.mgrid[0:a.height, 0:a.width].astype(np.float32)
    flow = a.flow["forward"]
    warped = cv2.remap(b.picture, x + flow[..., 0], y + flow[..., 1], cv2.INTER_LINEAR)
    seen = a.state["forward"] == 0
    grey = lambda picture: cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
    sums["warped"].append(np.abs(warped.astype(float) - a.picture)[seen].mean())
    sums["unwarped"].append(np.abs(b.picture.astype(float) - a.picture)[seen].mean())
    read_off = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(grey(a.picture), grey(b.picture),
                                                                                 None)
    edges = cv2.Canny(grey(a.picture), 40, 100) > 0  # where there is something to go by
    sums["read_off"].append(np.linalg.norm(read_off - flow, axis=-1)[seen & edges])
    sums["flow"].append(np.linalg.norm(flow, axis=-1)[seen & edges])


def flow_arrows(view):
    picture = view.picture.copy()
    for y in range(8, view.height, 16):
        for x in range(8, view.width, 16):
            dx, dy = 4.0 * view.flow["forward"][y, x]
            color = [(80, 255, 80), (60, 60, 255), (255, 120, 60), (160, 160, 160)][int(view.state["forward"][y, x])]
            cv2.arrowedLine(picture, (x, y), (int(round(x + dx)), int(round(y + dy))), color, 1, cv2.LINE_AA)
    return picture


def check_clip(dataset, clip, pictures):
    basic = dataset / "basic"
    cameras = sorted(folder.name for folder in basic.glob("rp_*"))
    check(len(cameras) >= 2, "there are no two cameras")
    ids = {}
    tracks = {}  # (camera, frame) -> {id: (x, y, w, h, pixels)}
    sums = {way: dict(off=[], wrong_inside=0, seen=0, outside=0, hidden=0, other_ids=0, not_hidden=0) for way in ("forward", "backward")}
    looks = dict(warped=[], unwarped=[], read_off=[], flow=[])
    speeds = []
    sheets = []
    for camera in cameras:
        last = None
        for frame in range(clip["frame_count"]):
            view = View(basic / camera, clip["first_capture"] + frame)
            for number, path in view.objects().items():
                check(ids.setdefault(path, number) == number, f"{path} has the ids {ids[path]} and {number}")
            boxes = {}
            for number in view.objects():
                rows, columns = np.nonzero(view.ids == number)
                if len(rows):
                    boxes[number] = (int(columns.min()), int(rows.min()), int(np.ptp(columns)) + 1,
                                     int(np.ptp(rows)) + 1, len(rows))
            tracks[camera[3:], frame] = boxes
            for way, edge in (("forward", clip["frame_count"] - 1), ("backward", 0)):
                if frame == edge:
                    check((view.state[way] == 3).all() and not view.flow[way].any(),
                          f"{camera}: flow {way} of frame {frame}, where the clip ends")
            if last is not None:
                check_flow(last, view, "forward", sums["forward"])
                check_flow(view, last, "backward", sums["backward"])
                check_pictures(last, view, looks)
                for path, now in view.velocities.items():
                    before = last.velocities.get(path)
                    if before is None or path not in view.poses or path not in last.poses:
                        continue
                    moved = (view.poses[path][:3, 3] - last.poses[path][:3, 3]) * clip["fps"]
                    mean = 0.5 * (np.array(now["linear"]) + np.array(before["linear"]))
                    speeds.append(np.linalg.norm(moved - mean))
            if pictures and camera == cameras[0] and frame % max(1, clip["frame_count"] // 8) == 0:
                sheets.append(np.vstack([view.picture, flow_arrows(view)]))
            last = view
    check(len(set(ids.values())) == len(ids), "two nodes share an id")
    for way, sum_ in sums.items():
        off = np.concatenate(sum_["off"])
        median, high = float(np.median(off)), float(np.quantile(off, 0.999))
        print(f"flow {way}: {len(off)} seen points, off by {median:.2g} px (median), {high:.2g} px (0.999), "
              f"{off.max():.2g} px (most); {sum_['hidden']} hidden, {sum_['outside']} left; "
              f"{sum_['other_ids'] / sum_['seen']:.4f} of the seen meet another id")
        check(median <= 0.1 and high <= 0.1, f"flow {way} is off by {median} px, {high} px")
        # The border of the picture is met to a ten-thousandth of a pixel, as flow is single precision.
        check(sum_["wrong_inside"] <= 1e-5 * sum_["seen"], f"flow {way}: {sum_['wrong_inside']} states of who leaves the picture")
        check(sum_["other_ids"] <= 0.02 * sum_["seen"], f"flow {way}: {sum_['other_ids']} seen points meet other ids")
        check(sum_["not_hidden"] <= 0.02 * max(1, sum_["hidden"]), f"flow {way}: {sum_['not_hidden']} hidden by nothing")
        check(sum_["hidden"] > 0 and sum_["outside"] > 0, f"flow {way}: nothing is hidden, or leaves")
    read_off, flow = (float(np.median(np.concatenate(looks[key]))) for key in ("read_off", "flow"))
    print(f"pictures: fetched back by flow they differ by {np.mean(looks['warped']):.2f} of 255, as they are by "
          f"{np.mean(looks['unwarped']):.2f}; OpenCV's optical flow is {read_off:.2f} px from ours, of {flow:.2f} px "
          f"(medians, at edges)")
    check(np.mean(looks["warped"]) < np.mean(looks["unwarped"]), "warping by flow makes pictures no more alike")
    check(read_off < 0.5 * flow, f"optical flow read off the pictures is {read_off} px away, of {flow}")
    print(f"ids: {len(ids)} objects, one id each; velocities: {np.median(speeds):.2g} m/s from the way between frames "
          f"(median of {len(speeds)})")
    check(np.median(speeds) < 0.05, "velocities do not lead from place to place")
    if pictures:
        pictures.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(pictures / "frames_and_flow.png"), np.vstack([np.hstack(sheets[:4]), np.hstack(sheets[4:8])]))
    return [camera[3:] for camera in cameras], tracks


# Formats of others -----------------------------------------------------------------------------------------------

def read_mot(folder):
    """What mmtracking's converter and TrackEval's loader demand of a sequence."""
    lines = (folder / "seqinfo.ini").read_text().split("\n")
    values = [line.strip().split("=")[1] for line in lines[1:7]]
    name, image_folder, (rate, length, width, height) = values[0], values[1], map(int, values[2:])
    check(name == folder.name, f"{folder}: seqinfo.ini is of {name}")
    page = configparser.ConfigParser()
    page.read(folder / "seqinfo.ini")
    check(int(page["Sequence"]["seqLength"]) == length, f"{folder}: seqLength")
    images = sorted(file.name for file in (folder / image_folder).iterdir())
    check(images == [f"{i + 1:06d}{page['Sequence']['imExt']}" for i in range(length)], f"{folder}: names of pictures")
    frames = [{} for _ in range(length)]
    for line in (folder / "gt/gt.txt").read_text().splitlines():
        fields = line.split(",")
        check(len(fields) == 9, f"{folder}: {len(fields)} fields in {line}")
        frame, track = int(fields[0]), int(fields[1])
        x, y, w, h, mark = map(float, fields[2:7])
        check(1 <= frame <= length and track > 0, f"{folder}: {line}")
        check(mark == 1 and int(fields[7]) >= 1 and 0 <= float(fields[8]) <= 1, f"{folder}: {line}")
        check(x >= 1 and y >= 1 and x + w <= width + 1 and y + h <= height + 1, f"{folder}: box of {line}")
        check(track not in frames[frame - 1], f"{folder}: {track} is twice in frame {frame}")
        frames[frame - 1][track] = (x - 1, y - 1, w, h)
    return frames, rate


def read_kitti(root, sequence, length):
    """Seventeen columns as the development kit of the tracking benchmark lists them."""
    frames = [{} for _ in range(length)]
    last = 0
    for line in (root / "label_02" / f"{sequence}.txt").read_text().splitlines():
        fields = line.split(" ")
        check(len(fields) == 17, f"{sequence}: {len(fields)} columns in {line}")
        frame, track = int(fields[0]), int(fields[1])
        check(last <= frame < length, f"{sequence}: frame {frame} behind {last}")
        last = frame
        check(fields[2] == "DontCare" or track >= 0, f"{sequence}: track {track}")
        check(int(fields[3]) in (0, 1, 2) and int(fields[4]) in (0, 1, 2, 3), f"{sequence}: truncated, occluded: {line}")
        numbers = [float(field) for field in fields[5:]]
        check(-np.pi - 0.01 <= numbers[0] <= np.pi + 0.01 and -np.pi - 0.01 <= numbers[11] <= np.pi + 0.01,
              f"{sequence}: angles of {line}")
        check(min(numbers[5:8]) > 0, f"{sequence}: dimensions of {line}")
        x0, y0, x1, y1 = numbers[1:5]
        check(track not in frames[frame], f"{sequence}: {track} is twice in frame {frame}")
        frames[frame][track] = (x0, y0, x1 - x0, y1 - y0)
    calibration = dict(line.split(":", 1) for line in (root / "calib" / f"{sequence}.txt").read_text().splitlines()
                       if ":" in line)
    for key in ("P0", "P1", "P2", "P3"):
        check(len(calibration.get(key, "").split()) == 12, f"{sequence}: {key} of the calibration")
    pictures = sorted(file.stem for file in (root / "image_02" / sequence).iterdir())
    check(pictures == [f"{i:06d}" for i in range(length)], f"{sequence}: names of pictures")
    return frames


def mask_of(rle):
    """Runs by columns, of nothing first; as a list or as pycocotools packs them."""
    counts = rle["counts"]
    if isinstance(counts, str):
        runs, at = [], 0
        while at < len(counts):
            value, shift, more = 0, 0, True
            while more:
                bits = ord(counts[at]) - 48
                value |= (bits & 0x1F) << (5 * shift)
                more = bool(bits & 0x20)
                at, shift = at + 1, shift + 1
                if not more and bits & 0x10:
                    value |= -1 << (5 * shift)
            runs.append(value + (runs[-2] if len(runs) > 2 else 0))
        counts = runs
    height, width = rle["size"]
    check(sum(counts) == height * width, "runs of a mask do not fill the picture")
    flat = np.repeat(np.arange(len(counts)) % 2, counts)
    return flat.reshape(width, height).T.astype(bool)


def box_of(mask):
    rows, columns = np.nonzero(mask)
    return [int(columns.min()), int(rows.min()), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]


def read_coco(file, fps):
    """What COCO(...) of pycocotools indexes, and what VIS loaders take from it."""
    coco = json.loads(file.read_text())
    images = {image["id"]: image for image in coco["images"]}
    categories = {category["id"] for category in coco["categories"]}
    check(len(images) == len(coco["images"]), f"{file}: two images of one id")
    check(len({a["id"] for a in coco["annotations"]}) == len(coco["annotations"]), f"{file}: annotations share ids")
    frames = {}
    for image in images.values():
        check(abs(image["time_s"] - image["frame_index"] / fps) < 1e-6, f"{file}: time of image {image['id']}")
        frames.setdefault(image["video_id"], {})[image["frame_index"]] = {}
    for annotation in coco["annotations"]:
        image = images[annotation["image_id"]]
        check(annotation["category_id"] in categories, f"{file}: category of annotation {annotation['id']}")
        boxes = frames[image["video_id"]][image["frame_index"]]
        check(annotation["track_id"] not in boxes, f"{file}: track {annotation['track_id']} twice in an image")
        boxes[annotation["track_id"]] = tuple(annotation["bbox"])
    return frames


def read_youtube_vis(file, fps):
    """As frPyObjects and TrackEval take it: runs as lists, lists as long as the video, one sequence a name."""
    vis = json.loads(file.read_text())
    videos = {video["id"]: video for video in vis["videos"]}
    names = [video["file_names"][0].split("/")[0] for video in vis["videos"]]
    check(len(set(names)) == len(videos), f"{file}: names of sequences are not unique")
    categories = {category["id"] for category in vis["categories"]}
    check(len({track["id"] for track in vis["annotations"]}) == len(vis["annotations"]), f"{file}: tracks share ids")
    frames = {key: {i: {} for i in range(video["length"])} for key, video in videos.items()}
    for track in vis["annotations"]:
        video = videos[track["video_id"]]
        check(video["fps"] == fps, f"{file}: fps of video {video['id']}")
        check(track["category_id"] in categories and track["iscrowd"] in (0, 1), f"{file}: track {track['id']}")
        check((track["height"], track["width"]) == (video["height"], video["width"]), f"{file}: size of {track['id']}")
        lists = [track[key] for key in ("segmentations", "bboxes", "areas")]
        check({len(each) for each in lists} == {video["length"], len(video["file_names"])}, f"{file}: {track['id']}")
        for frame, (mask, box, area) in enumerate(zip(*lists)):
            check((mask is None) == (box is None) == (area is None), f"{file}: {track['id']} frame {frame}")
            if mask is None:
                continue
            check(isinstance(mask["counts"], list), f"{file}: counts are no list")
            pixels = mask_of(mask)
            check(pixels.sum() == area and box_of(pixels) == list(box), f"{file}: {track['id']} frame {frame}: mask")
            frames[track["video_id"]][frame][track["track_id"]] = tuple(box)
    return frames


def scores(truth, tracker, threshold=0.5):
    """CLEAR's MOTA and switches, and IDF1, as their papers define them; boxes by track, per frame."""
    def overlap(a, b):
        width = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
        height = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
        common = max(0.0, width) * max(0.0, height)
        return common / (a[2] * a[3] + b[2] * b[3] - common)

    missed = false = switches = total = found = 0
    held, pairs = {}, {}
    for real, told in zip(truth, tracker):
        mine, theirs = list(real), list(told)
        total, found = total + len(mine), found + len(theirs)
        value = np.array([[overlap(real[a], told[b]) for b in theirs] for a in mine]).reshape(len(mine), len(theirs))
        for i, j in np.argwhere(value >= threshold):
            pairs[mine[i], theirs[j]] = pairs.get((mine[i], theirs[j]), 0) + 1
        kept = np.array([[held.get(a) == b for b in theirs] for a in mine]).reshape(value.shape)
        rows, columns = linear_sum_assignment(-np.where(value >= threshold, value + 1000.0 * kept, 0.0))
        matches = [(mine[i], theirs[j]) for i, j in zip(rows, columns) if value[i, j] >= threshold]
        missed, false = missed + len(mine) - len(matches), false + len(theirs) - len(matches)
        for a, b in matches:
            switches += held.get(a, b) != b
            held[a] = b
    tracks = [sorted({pair[k] for pair in pairs}) for k in (0, 1)]
    table = np.array([[pairs.get((a, b), 0) for b in tracks[1]] for a in tracks[0]]).reshape(len(tracks[0]), -1)
    best = table[linear_sum_assignment(-table)].sum() if table.size else 0
    return 1.0 - (missed + false + switches) / max(1, total), switches, 2.0 * best / max(1, total + found)


def check_tracks(dataset, clip, place, cameras, tracks):
    length = clip["frame_count"]
    for order, camera in enumerate(cameras):
        own = [{key: box[:4] for key, box in tracks[camera, frame].items()} for frame in range(length)]
        video = place * len(cameras) + order
        mot = next(dataset.glob(f"mot/*/clip_{place:04d}_{camera}"))
        sources = {}
        sources["MOT"], rate = read_mot(mot)
        check(rate == clip["fps"], f"{mot}: frameRate {rate}")
        sources["KITTI"] = read_kitti(dataset / "kitti/training", f"{video:04d}", length)
        for name, read, pattern in (("COCO", read_coco, "coco/annotations/instances_*.json"),
                                    ("YouTube-VIS", read_youtube_vis, "coco/youtube_vis/*.json")):
            for file in dataset.glob(pattern):
                frames = read(file, clip["fps"])
                if video + 1 in frames:
                    sources[name] = [frames[video + 1][frame] for frame in range(length)]
        check(len(sources) == 4, f"{camera}: tracks only in {sorted(sources)}")
        for name, frames in sources.items():
            # BasicWriter has ids of its own; whoever scores 1 has one name for each of them.
            check([set(frame) for frame in frames] == [set(frame) for frame in sources["MOT"]],
                  f"{camera}: tracks of {name} are not those of MOT")
            mota, switches, idf1 = scores(own, frames)
            check((mota, switches, idf1) == (1.0, 0, 1.0), f"{camera}: {name} scores {mota}, {switches}, {idf1}")
        # The judge is judged: two tracks that change names halfway are two switches.
        told = sources["MOT"]
        longest = sorted({key for frame in told for key in frame}, key=lambda key: -sum(key in f for f in told))[:2]
        swapped = [{(dict(zip(longest, longest[::-1])).get(key, key) if at >= length // 2 else key): box
                    for key, box in frame.items()} for at, frame in enumerate(told)]
        mota, switches, idf1 = scores(own, swapped)
        check(switches == 2 and idf1 < 1.0, f"{camera}: swapped names score {mota}, {switches}, {idf1}")
        boxes = sum(len(frame) for frame in own)
        print(f"tracks of {camera}: {boxes} boxes in MOT, KITTI, COCO and YouTube-VIS, MOTA 1, IDF1 1, no switch; two "
              f"names swapped halfway: {switches} switches, IDF1 {idf1:.3f}")


def check_video(dataset, clip, place, cameras):
    file = dataset / "video" / f"clip_{place:04d}.mp4"
    video = cv2.VideoCapture(str(file))
    check(video.isOpened(), f"{file} does not open")
    check(abs(video.get(cv2.CAP_PROP_FPS) - clip["fps"]) < 1e-6, f"{file}: {video.get(cv2.CAP_PROP_FPS)} per second")
    worst, count = 99.0, 0
    while True:
        is_read, picture = video.read()
        if not is_read:
            break
        for order, camera in enumerate(cameras):
            name = f"rgb_{clip['first_capture'] + count:04d}.png"
            expected = cv2.imread(str(dataset / "basic" / f"rp_{camera}" / "rgb" / name))
            height, width = expected.shape[:2]
            worst = min(worst, cv2.PSNR(picture[:height, order * width:(order + 1) * width], expected))
        count += 1
    check(count == clip["frame_count"], f"{file}: {count} frames")
    check(worst > 25.0, f"{file}: a frame is {worst:.1f} dB from its picture")
    told = "no ffprobe here"
    if shutil.which("ffprobe"):
        told = subprocess.run(["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries",
                               "stream=codec_name,nb_read_frames,r_frame_rate", "-of", "csv=p=0", str(file)],
                              capture_output=True, text=True).stdout.strip()
        check(told.split(",")[-1] == str(clip["frame_count"]), f"{file}: ffprobe says {told}")
        told = "ffprobe says " + told
    print(f"video: OpenCV decodes {count} frames, at worst {worst:.1f} dB from the pictures; {told}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--pictures", type=pathlib.Path)
    options = parser.parse_args()
    clips = json.loads((options.dataset / "basic/clips.json").read_text())["clips"]
    check(clips, "there are no clips")
    for place, clip in enumerate(clips):
        cameras, tracks = check_clip(options.dataset, clip, options.pictures)
        check_tracks(options.dataset, clip, place, cameras, tracks)
        check_video(options.dataset, clip, place, cameras)
    for fault in FAULTS[:40]:
        print(f"fault: {fault}")
    print(f"{len(FAULTS)} faults")
    return 1 if FAULTS else 0


if __name__ == "__main__":
    sys.exit(main())
