#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Judges whether cameras that walk through a room hit anything, with nothing of the program but the room's triangles:

    tests/clips/check_walk.py [--seeds 4] [--build FOLDER] [--assets-root FOLDER] [--room FILE] [--output FOLDER]

Runs a job of clips in which things fall and drift while two cameras of a rig walk with a shaking hand. Rooms are exported
as USD text, which is read here, and numpy measures from every camera of every frame

- how far it is to the nearest triangle of the room: not nearer than the job's clearance;
- whether the straight way from frame to frame goes through one: never;
- how far it is to the boxes of things, where any camera of the frame shows them;
- how far it came, and how it sped: nobody stands where there is room, nor goes faster than was asked for.

Ends with "0 faults" and 0, or tells the faults and ends with 1.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
CLEARANCE, SPEED, FPS = 0.25, 1.2, 15
JOB = """
seed: {seed}
total_captures: {captures}
environments: [{environment}]
environment: {{working_area: "{area}"}}
objects:
  - {{type: shapes, name: falls, under: /Assets, count: 8, label_pattern: "^"}}
  - {{type: shapes, name: drifts, under: /Assets, count: 4, label_pattern: "^", gravity_disabled_chance: 1.0}}
lights: [{{type: dome, name: sky}}]
cameras:
  - {{type: pinhole, name: eyes, width: 96, height: 72, focal_length_mm: 10, rig: [{{name: left}}, {{name: right, position: [0.1, 0, 0]}}]}}
randomizers:
  - {{type: scatter_poses, name: poses, on: [environment], nodes: "/Assets/*", scale: [0.04, 0.12],
     offset: [[-1.5, 1.5], [-1.5, 1.5], [0.8, 1.6]]}}
  - {{type: random_velocities, name: drift, on: [environment], nodes: "/Assets/*", velocity: [[-0.6, 0.6], [-0.6, 0.6], [-0.2, 0.2]]}}
  - {{type: camera_path, name: walk, on: [clip], nodes: "/Cameras/*", kind: walk, area: [[-2.5, 2.5], [-2.5, 2.5], [{low}, {high}]],
     speed: {speed}, clearance_m: {clearance}, look: ahead, max_tries: 4000, jitter_m: 0.03, jitter_deg: 1.0}}
settle: {{policy: keep}}
renderer: {{type: "null"}}
timeline: [{{record: {{fps: {fps}, seconds: 4}}}}]
writers: [{{type: BasicWriter, name: basic, camera_params: true, bounding_box_3d: true}}]
output: {{folder: out}}
"""
FAULTS = []


def check(holds, what):
    if not holds:
        FAULTS.append(what)


def numbers(text):
    return np.array(re.sub(r"[()\[\],]", " ", text).split(), dtype=float)


def triangles_of(usda):
    """Of all visible meshes, in the space of the root prim, whose own pose is where the asset stands."""
    found = []
    stack = []  # (world_from_prim, is_visible, properties)
    world = np.eye(4)
    for line in usda.read_text().splitlines():
        text = line.strip()
        if text.startswith("def "):
            stack.append({"pose": np.eye(4), "seen": True, "is_mesh": text.startswith("def Mesh")})
        elif text == "}" and stack:
            prim = stack[-1]
            chain = [p["pose"] for p in stack]
            if prim["is_mesh"] and all(p["seen"] for p in stack) and "points" in prim:
                world = np.eye(4)
                for pose in chain:
                    world = world @ pose
                points = prim["points"].reshape(-1, 3) @ world[:3, :3].T + world[:3, 3]
                begin = 0
                for count in prim["counts"].astype(int):
                    face = prim["indices"][begin:begin + count].astype(int)
                    begin += count
                    found += [points[[face[0], face[k], face[k + 1]]] for k in range(1, count - 1)]
            stack.pop()
        elif stack and " = " in text:
            head, value = text.split(" = ", 1)
            name = head.split()[-1]
            if name == "xformOp:transform":
                stack[-1]["pose"] = numbers(value).reshape(4, 4).T
            elif name == "xformOp:translate":
                stack[-1]["pose"] = np.eye(4)
                stack[-1]["pose"][:3, 3] = numbers(value)
            elif name == "visibility":
                stack[-1]["seen"] = "invisible" not in value
            elif name in ("points", "faceVertexCounts", "faceVertexIndices") and stack[-1]["is_mesh"]:
                stack[-1][{"points": "points", "faceVertexCounts": "counts"}.get(name, "indices")] = numbers(value)
    return np.array(found)


def distance_to_triangles(point, a, b, c):
    """The least one. By planes and edges: of a point and many triangles."""
    ab, ac, ap = b - a, c - a, point - a
    normal = np.cross(ab, ac)
    square = np.einsum("ij,ij->i", normal, normal)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = np.einsum("ij,ij->i", np.cross(ap, ac), normal) / square
        w = np.einsum("ij,ij->i", np.cross(ab, ap), normal) / square
        plane = np.abs(np.einsum("ij,ij->i", ap, normal)) / np.sqrt(square)
    best = np.where((square > 0) & (v >= 0) & (w >= 0) & (v + w <= 1), plane, np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        length = np.einsum("ij,ij->i", along, along)
        share = np.clip(np.einsum("ij,ij->i", point - start, along) / np.where(length > 0, length, 1), 0, 1)
        best = np.minimum(best, np.linalg.norm(start + share[:, None] * along - point, axis=1))
    return best.min()


def crosses(start, end, a, b, c):
    """Whether the way goes through any triangle (Moeller and Trumbore)."""
    along = end - start
    ab, ac = b - a, c - a
    p = np.cross(along, ac)
    determinant = np.einsum("ij,ij->i", ab, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = start - a
        u = np.einsum("ij,ij->i", t, p) / determinant
        q = np.cross(t, ab)
        v = q @ along / determinant
        w = np.einsum("ij,ij->i", ac, q) / determinant
    return bool(np.any((np.abs(determinant) > 0) & (u >= 0) & (v >= 0) & (u + v <= 1) & (w >= 0) & (w <= 1)))


def places_of(folder, camera, captures):
    places = []
    for i in range(captures):
        params = json.loads((folder / f"rp_{camera}/camera_params/camera_params_{i:04d}.json").read_text())
        view = np.array(params["cameraViewTransform"]).reshape(4, 4).T
        places.append(np.linalg.inv(view)[:3, 3])
    return np.array(places)


def boxes_of(folder, cameras, capture):
    """Things that a camera of the frame shows: pose and half extent by path."""
    boxes = {}
    for camera in cameras:
        base = folder / f"rp_{camera}/bounding_box_3d"
        names = json.loads((base / f"bounding_box_3d_prim_paths_{capture:04d}.json").read_text())
        for name, box in zip(names, np.load(base / f"bounding_box_3d_{capture:04d}.npy")):
            if not name.startswith("/Assets/"):
                continue
            low = np.array([box["x_min"], box["y_min"], box["z_min"]], float)
            high = np.array([box["x_max"], box["y_max"], box["z_max"]], float)
            boxes[name] = (box["transform"].astype(float).T, low, high)
    return boxes


def distance_to_box(place, pose, low, high):
    local = np.linalg.inv(pose) @ np.append(place, 1.0)
    off = np.maximum(np.maximum(low - local[:3], local[:3] - high), 0.0)
    return np.linalg.norm(pose[:3, :3] @ off)


def judge(options, seed, environment, asset, area):
    folder = (options.output or pathlib.Path(tempfile.mkdtemp())) / f"walk_{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    captures = 4 * FPS
    low, high = options.height
    (folder / "job.yaml").write_text(JOB.format(seed=seed, captures=captures, environment=environment, area=area, speed=SPEED,
                                                clearance=CLEARANCE, fps=FPS, low=low, high=high))
    program = options.build / "bin" / "diorama"
    root = ["--assets-root", options.assets_root] if options.assets_root else []
    ended = subprocess.run([program, "run", folder / "job.yaml", "--output", folder / "out", "--overwrite", *root],
                           stderr=subprocess.PIPE, text=True)
    if ended.returncode:
        sys.exit(f"seed {seed}: {ended.stderr[-2000:]}")
    stood = "found no place" in ended.stderr
    room = folder / "room.usda"
    subprocess.run([program, "export", asset, room, *root], check=True, stdout=subprocess.DEVNULL)
    triangles = triangles_of(room)
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    cameras = ["eyes_0_left", "eyes_0_right"]
    places = {camera: places_of(folder / "out/basic", camera, captures) for camera in cameras}
    nearest, nearest_thing = np.inf, np.inf
    for camera, way in places.items():
        for i, place in enumerate(way):
            nearest = min(nearest, distance_to_triangles(place, a, b, c))
            if i and np.linalg.norm(place - way[i - 1]) > 0:
                check(not crosses(way[i - 1], place, a, b, c), f"seed {seed}, {camera}, frame {i}: goes through the room")
    for i in range(captures):
        for name, (pose, lower, upper) in boxes_of(folder / "out/basic", cameras, i).items():
            for camera in cameras:
                distance = distance_to_box(places[camera][i], pose, lower, upper)
                nearest_thing = min(nearest_thing, distance)
                check(distance > 0.0, f"seed {seed}, {camera}, frame {i}: inside of the box of {name}")
    steps = np.linalg.norm(np.diff(places[cameras[0]], axis=0), axis=1)
    # The hand's shaking comes on top.
    check(np.median(steps) <= SPEED / FPS + 0.02, f"seed {seed}: goes at {np.median(steps) * FPS:.2f} m/s")
    if not stood:
        check(nearest >= CLEARANCE, f"seed {seed}: {nearest:.4f} m from the room, {CLEARANCE} m were asked for")
    print(f"seed {seed}: {len(triangles)} triangles, nearest {nearest:.3f} m, things {nearest_thing:.3f} m, "
          f"{steps.sum():.2f} m walked{', stood: no place' if stood else ''}")
    return steps.sum()


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build/release")
    parser.add_argument("--assets-root", type=pathlib.Path)
    parser.add_argument("--room", help="a file; the generated dining rooms when absent")
    parser.add_argument("--area", default="**/*TableDining*", help="what the walk's area is about")
    parser.add_argument("--height", type=float, nargs=2, default=(0.5, 1.1), help="above it")
    parser.add_argument("--output", type=pathlib.Path)
    options = parser.parse_args()
    walked = []
    for seed in range(1, options.seeds + 1):
        asset = options.room or f"dining_room:{seed}"
        environment = (f'{{type: files, files: ["{options.room}"]}}' if options.room else
                       f"{{type: dining_room, first_seed: {seed}, count: 1}}")
        walked.append(judge(options, seed, environment, asset, options.area))
    check(np.median(walked) > 0.35 * SPEED * 4, f"half of the walks are shorter than {np.median(walked):.2f} m")
    for fault in FAULTS[:20]:
        print(fault)
    print(f"{len(FAULTS)} faults")
    return 1 if FAULTS else 0


if __name__ == "__main__":
    sys.exit(main())
