#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Trains a small network to say of every pixel what it shows: segment.py DATASET [--epochs 40]

Needs python3-torch; runs on a CPU. See README.md for what the result says and what it does not."""
import argparse
import pathlib
import struct
import time
import zlib

import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader, Dataset

import diorama


class Pictures(Dataset):
    """Per capture, of all its cameras: colour, float32 (cameras, 3, height, width) from 0 to 1; and which class each pixel has,
    int64 (cameras, height, width), 0 for none."""

    def __init__(self, folder, places, classes):
        self.captures = diorama.open(folder, wanted=["color", "instance_id", "instances", "labels"])
        self.places = places
        self.number = {name: i + 1 for i, name in enumerate(classes)}

    def __len__(self):
        return len(self.places)

    def __getitem__(self, i):
        frames = self.captures[self.places[i]].frames
        colors = [torch.from_numpy(frame.channels["color"][:, :, :3].copy()).permute(2, 0, 1) / 255.0 for frame in frames]
        return torch.stack(colors), torch.stack([self.classes_of(frame) for frame in frames])

    def classes_of(self, frame):
        classes = np.zeros(frame.channels["color"].shape[:2], np.int64)
        for instance in frame.instances:
            if frame.has_mask(instance):
                classes[frame.mask(instance)] = self.number.get(instance.labels.get("class"), 0)
        return torch.from_numpy(classes)


def joined(items):
    """Of several captures: one batch of all their pictures."""
    return tuple(torch.cat(parts) for parts in zip(*items))


def grown(small, size):
    return nn.functional.interpolate(small, size=size, mode="bilinear", align_corners=False)


class Net(nn.Module):
    """A U-Net: looks at the picture at a half, a quarter and an eighth of its size, and brings what it saw back together."""

    def __init__(self, outputs):
        super().__init__()
        self.fine = nn.Sequential(self.step(3, 16, stride=2), self.step(16, 16))
        self.middle = nn.Sequential(self.step(16, 32, stride=2), self.step(32, 32))
        self.coarse = nn.Sequential(self.step(32, 64, stride=2), self.step(64, 64))
        self.join_middle = self.step(64 + 32, 32)
        self.join_fine = self.step(32 + 16, 16)
        self.last = nn.Conv2d(16, outputs, 1)

    @staticmethod
    def step(inputs, outputs, stride=1):
        return nn.Sequential(nn.Conv2d(inputs, outputs, 3, stride, padding=1), nn.BatchNorm2d(outputs), nn.ReLU())

    def forward(self, x):
        fine = self.fine(x)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        middle = self.join_middle(torch.cat([grown(coarse, middle.shape[2:]), middle], 1))
        fine = self.join_fine(torch.cat([grown(middle, fine.shape[2:]), fine], 1))
        return grown(self.last(fine), x.shape[2:])


def overlaps(model, loader, count):
    """Intersection over union of each class, all pictures together: 1 where the answer is the label, pixel by pixel."""
    model.eval()
    confusion = torch.zeros(count, count)
    with torch.no_grad():
        for color, label in loader:
            pairs = label * count + model(color).argmax(1)
            confusion += torch.bincount(pairs.flatten(), minlength=count * count).reshape(count, count)
    model.train()
    both = confusion.diag()
    return (both / (confusion.sum(0) + confusion.sum(1) - both).clamp(min=1))[1:]


def save_png(file, pixels):
    """pixels: uint8, height x width x 3."""
    height, width = pixels.shape[:2]
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    chunks = ((b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    with open(file, "wb") as out:
        out.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in chunks:
            out.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)))


def save_answers(file, model, pictures, columns=6):
    """Of pictures far from each other: above the picture, in the middle its labels, below what the network says."""
    colors = torch.tensor([[40, 40, 40], [230, 60, 60], [60, 130, 240], [250, 210, 60], [70, 190, 100], [190, 90, 220], [240, 140, 40]])
    strips = []
    model.eval()
    for i in range(columns):
        color, label = (part[:1] for part in pictures[i * len(pictures) // columns])
        with torch.no_grad():
            answer = model(color).argmax(1)
        named = [colors[torch.where(classes > 0, (classes - 1) % 6 + 1, 0)] for classes in (label, answer)]
        strips.append(torch.cat([(color * 255).permute(0, 2, 3, 1)] + named, 1))
    save_png(file, torch.cat(strips, 2)[0].to(torch.uint8).numpy())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset")
    parser.add_argument("--epochs", type=int, default=40, help="how often every picture is seen")
    parser.add_argument("--workers", type=int, default=2, help="processes that read")
    parser.add_argument("--start", choices=("fork", "spawn"), default="fork", help="how they begin")
    parser.add_argument("--picture", help="where to draw some answers; by default answers.png beside the dataset's folder")
    arguments = parser.parse_args()
    torch.manual_seed(1)

    begin = time.monotonic()
    labels = diorama.open(arguments.dataset, wanted=["instances", "labels"])
    found = (instance.labels for capture in labels for frame in capture.frames for instance in frame.instances)
    classes = sorted({each["class"] for each in found if "class" in each})
    # Captures of one room follow each other, so the last quarter shows rooms that the others do not.
    count, learnt = len(labels), len(labels) * 3 // 4
    train = Pictures(arguments.dataset, range(learnt), classes)
    judge = Pictures(arguments.dataset, range(learnt, count), classes)
    batches = DataLoader(train, batch_size=4, shuffle=True, collate_fn=joined, num_workers=arguments.workers,
                         persistent_workers=arguments.workers > 0, multiprocessing_context=arguments.start if arguments.workers else None)
    judged = DataLoader(judge, batch_size=4, collate_fn=joined)
    print(f"{len(train)} captures to learn from, {len(judge)} of other rooms to judge by; {', '.join(classes)}")

    model = Net(1 + len(classes))
    optimizer = torch.optim.Adam(model.parameters())
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, 1e-2, epochs=arguments.epochs, steps_per_epoch=len(batches))
    print(f"before: mean overlap {overlaps(model, judged, 1 + len(classes)).mean():.3f}", flush=True)
    for epoch in range(arguments.epochs):
        losses = []
        for color, label in batches:
            if torch.rand(()) < 0.5:
                color, label = color.flip(3), label.flip(2)
            color = color * (0.7 + 0.6 * torch.rand(len(color), 3, 1, 1))  # other light
            loss = nn.functional.cross_entropy(model(color), label)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
            losses.append(loss.item())
        if epoch % 4 == 3:
            print(f"{time.monotonic() - begin:5.0f} s  epoch {epoch + 1:3}  loss {np.mean(losses):.3f}  "
                  f"mean overlap in other rooms {overlaps(model, judged, 1 + len(classes)).mean():.3f}", flush=True)
    for name, overlap in zip(classes, overlaps(model, judged, 1 + len(classes))):
        print(f"  {name:20} {overlap:.3f}")
    picture = arguments.picture or pathlib.Path(arguments.dataset).resolve().parent / "answers.png"
    save_answers(picture, model, judge)
    print(f"pictures, labels and answers: {picture}")


if __name__ == "__main__":
    main()
