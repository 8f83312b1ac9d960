#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Trains a small network to find the labelled objects in pictures of a dataset: segment.py DATASET [--seconds 60]

Needs python3-torch; runs on a CPU. See README.md for what the result says and what it does not."""
import argparse
import time

import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader, Dataset

import diorama


class Pictures(Dataset):
    """Per capture and for its cameras: colour, float32 (cameras, 3, height, width) from 0 to 1, and float32 (cameras, height,
    width): 1 where a labelled object is seen."""

    def __init__(self, folder, places):
        self.captures = diorama.open(folder, wanted=["color", "instance_id", "instances", "labels"])
        self.places = places

    def __len__(self):
        return len(self.places)

    def __getitem__(self, i):
        frames = self.captures[self.places[i]].frames
        colors = [torch.from_numpy(frame.channels["color"][:, :, :3].copy()).permute(2, 0, 1) / 255.0 for frame in frames]
        masks = [torch.from_numpy(mask_of_objects(frame)) for frame in frames]
        return smaller(torch.stack(colors)), (smaller(torch.stack(masks)[:, None]) > 0.5).float()[:, 0]


def mask_of_objects(frame):
    objects = [instance.id for instance in frame.instances if "class" in instance.labels]
    return np.isin(frame.channels["instance_id"], objects).astype(np.float32)


def smaller(images):
    """An eighth as wide and high, which is enough for a lesson of a minute."""
    return nn.functional.avg_pool2d(images, 8)


def joined(items):
    """Of several captures: one batch of all their pictures."""
    return tuple(torch.cat(parts) for parts in zip(*items))


def grown(small, like):
    return nn.functional.interpolate(small, size=like.shape[2:], mode="bilinear", align_corners=False)


class Net(nn.Module):
    """Looks at the picture in three sizes; 60 thousand numbers to learn."""

    def __init__(self):
        super().__init__()
        self.fine = self.step(3, 16)
        self.middle = self.step(16, 32)
        self.coarse = self.step(32, 64)
        self.join_middle = self.step(64 + 32, 32)
        self.join_fine = self.step(32 + 16, 16)
        self.last = nn.Conv2d(16, 1, 1)

    @staticmethod
    def step(inputs, outputs):
        return nn.Sequential(nn.Conv2d(inputs, outputs, 3, padding=1), nn.GroupNorm(4, outputs), nn.ReLU())

    def forward(self, x):
        fine = self.fine(x)
        middle = self.middle(nn.functional.max_pool2d(fine, 2))
        coarse = self.coarse(nn.functional.max_pool2d(middle, 2))
        middle = self.join_middle(torch.cat([grown(coarse, middle), middle], 1))
        fine = self.join_fine(torch.cat([grown(middle, fine), fine], 1))
        return self.last(fine)[:, 0]


def loss_of(logits, mask):
    """Cross entropy, and one minus a smooth overlap: objects are rare, and by the first alone "nowhere" is a good answer."""
    share = torch.sigmoid(logits)
    smooth = 2.0 * (share * mask).sum() / (share.sum() + mask.sum() + 1.0)
    return nn.functional.binary_cross_entropy_with_logits(logits, mask) + 1.0 - smooth


def overlap(model, loader):
    """Intersection over union of all pictures together."""
    model.eval()
    both = either = 0.0
    with torch.no_grad():
        for color, mask in loader:
            found = model(color) > 0
            both += (found & (mask > 0)).sum().item()
            either += (found | (mask > 0)).sum().item()
    model.train()
    return both / max(either, 1.0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dataset")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--workers", type=int, default=2, help="processes that read")
    parser.add_argument("--start", choices=("fork", "spawn"), default="fork", help="how they begin")
    arguments = parser.parse_args()
    torch.manual_seed(1)

    begin = time.monotonic()
    # Captures of one room follow each other, so the last third of them shows rooms that the others do not.
    count = len(diorama.open(arguments.dataset))
    train = Pictures(arguments.dataset, range(count * 2 // 3))
    judge = Pictures(arguments.dataset, range(count * 2 // 3, count))
    batches = DataLoader(train, batch_size=2, shuffle=True, collate_fn=joined, num_workers=arguments.workers,
                         persistent_workers=arguments.workers > 0, multiprocessing_context=arguments.start if arguments.workers else None)
    judged = DataLoader(judge, batch_size=2, collate_fn=joined)
    share = float(torch.cat([mask for _, mask in judged]).mean())
    print(f"{len(train)} captures to learn from, {len(judge)} of other rooms to judge by, opened in {time.monotonic() - begin:.1f} s")
    print(f"objects are {100 * share:.1f} % of the pixels: who calls everything an object overlaps {share:.3f}")

    model = Net()
    optimizer = torch.optim.Adam(model.parameters(), lr=1e-2)
    begin = time.monotonic()
    epoch = 0
    while time.monotonic() - begin < arguments.seconds:
        losses = []
        for color, mask in batches:
            if torch.rand(()) < 0.5:
                color, mask = color.flip(3), mask.flip(2)
            color = color * (0.7 + 0.6 * torch.rand(len(color), 3, 1, 1))  # other light
            loss = loss_of(model(color), mask)
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            losses.append(loss.item())
        if epoch % 10 == 0:
            print(f"{time.monotonic() - begin:5.0f} s  epoch {epoch:3}  loss {np.mean(losses):.3f}  "
                  f"overlap in other rooms {overlap(model, judged):.3f}", flush=True)
        epoch += 1
    print(f"after {epoch} epochs: overlap {overlap(model, judged):.3f} in rooms that it never saw, "
          f"{overlap(model, DataLoader(train, batch_size=2, collate_fn=joined)):.3f} in those that it learnt from")


if __name__ == "__main__":
    main()
