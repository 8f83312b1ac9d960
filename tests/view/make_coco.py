#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A COCO dataset of many small pictures, for the page to show: tests/view/make_coco.py FOLDER CAPTURES

Classes and one picture have names that would be markup, one category has keypoints with a skeleton. Every fifth picture is upright.
"""
import json
import pathlib
import random
import struct
import sys
import zlib

WIDTH, HEIGHT = 64, 48
KEYPOINTS = ["head", "left hand", "right hand", "hip", "left foot", "right foot"]
SKELETON = [[1, 4], [1, 2], [1, 3], [4, 5], [4, 6]]
HOSTILE = "<img src=x onerror=alert(1)>"


def png(width, height, red, green, blue):
    """Darker to the right, with a bright square."""
    rows = b""
    for y in range(height):
        row = bytearray(b"\0")
        for x in range(width):
            light = 1.6 if 20 <= x < 40 and 12 <= y < 32 else 1 - x / 90
            row += bytes(min(255, int(value * light)) for value in (red, green, blue))
        rows += bytes(row)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def main():
    folder, captures = pathlib.Path(sys.argv[1]), int(sys.argv[2])
    draw = random.Random(1)
    tones = [[draw.randrange(30, 200) for _ in range(3)] for _ in range(24)]
    shapes = [(HEIGHT, WIDTH)] + [(WIDTH, HEIGHT)] * 4
    colours = [[png(*shape, *tone) for tone in tones] for shape in shapes]
    names = ["person", HOSTILE] + [f"class {i:02}" for i in range(18)]
    categories = [{"id": i + 1, "name": name} for i, name in enumerate(names)]
    categories[0].update(keypoints=KEYPOINTS, skeleton=SKELETON)
    (folder / "annotations").mkdir(parents=True)
    first = 1
    for split, count in (("train", captures - captures // 10), ("val", captures // 10)):
        pictures = folder / "images" / split
        pictures.mkdir(parents=True)
        images, annotations = [], []
        for image in range(first, first + count):
            name = f"{HOSTILE}.png" if image == 1 else f"{image:06}.png"
            columns, rows = shapes[image % 5]
            (pictures / name).write_bytes(colours[image % 5][image % 24])
            images.append({"id": image, "file_name": name, "width": columns, "height": rows})
            count_here = draw.randrange(1, 6)
            for place in range(count_here):
                # Side by side, so that masks have no pixel in common.
                strip = columns // count_here
                width, height = draw.randrange(4, strip), draw.randrange(4, 24)
                left, top = place * strip + draw.randrange(0, strip - width), draw.randrange(0, rows - height)
                category = draw.randrange(len(names)) + 1 if place > 0 else 1
                entry = {"id": len(annotations) + 1000000 * (split == "val") + 1, "image_id": image, "category_id": category,
                         "bbox": [left, top, width, height], "area": width * height, "iscrowd": 0,
                         "segmentation": [[left, top, left + width, top, left + width, top + height, left, top + height]]}
                if category == 1:
                    places = [(0.5, 0.1), (0.1, 0.4), (0.9, 0.4), (0.5, 0.55), (0.3, 0.95), (0.7, 0.95)]
                    sights = [draw.choice([2, 2, 2, 1, 0]) for _ in places]
                    entry["keypoints"] = [number for (x, y), sight in zip(places, sights) for number in
                                          ((left + x * width, top + y * height, sight) if sight else (0, 0, 0))]
                    entry["num_keypoints"] = sum(sight > 0 for sight in sights)
                annotations.append(entry)
        first += count
        (folder / "annotations" / f"instances_{split}.json").write_text(
            json.dumps({"images": images, "annotations": annotations, "categories": categories}))


main()
